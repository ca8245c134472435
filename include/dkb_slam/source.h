// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where frames come from: the interface for sources of one's own, and recorded folders.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/frame.h"

namespace dkb {

/// What a source has next.
enum class SourceState {
  frame,      ///< a pair of images
  skipped,    ///< a pair that could not be read; why is in `note`
  unplugged,  ///< a live device is gone for now; call next() again
  ended,      ///< there is nothing more
};

/// What Source::next() answers.
struct SourceFrame {
  SourceState state = SourceState::ended;  ///< what there is
  Frame frame;                             ///< when state is `frame`
  size_t index = 0;                        ///< of the pair in its recording; skipped pairs count
  std::string stamp;                       ///< the colour image's, as its recording writes it [s]
  std::string note;                        ///< why it was skipped
};

/// What a source has seen and could not hand out as frames. Each image or message counts once.
struct SourceCounts {
  int64_t dropped = 0;   ///< the consumer was too slow for them
  int64_t unpaired = 0;  ///< colour images without a depth image of their time, and the other way round
  int64_t late = 0;      ///< they came after their turn, or their stamp was not after the one before
};

/// Gives frames one after the other. One thread at a time calls next().
class DKB_SLAM_API Source {
 public:
  virtual ~Source() = default;
  /// The same for all frames.
  virtual const Camera& camera() const = 0;
  /// Waits for the next frame. The end and a device that is gone are states and no exceptions.
  virtual SourceFrame next() = 0;
  /// From any thread: a call of next() that waits, and those to come, answer `ended`.
  virtual void stop() {}
  /// What is worth telling people since the last call, a line each: a recording that was cut off, a clock that jumped.
  virtual std::vector<std::string> take_warnings() { return {}; }
  /// What has been lost so far.
  virtual SourceCounts counts() const { return {}; }
  /// How many pairs there are, where that is known. Of recordings about as many: not all of their images have partners.
  virtual std::optional<size_t> size() const { return std::nullopt; }
  /// For people: what is read, and by which list.
  virtual std::string description() const = 0;
};

/// Which prior of the motion a recording's frames are to carry.
enum class PriorKind {
  none,
  odometry,  ///< wheels or another estimate of the whole motion
  imu,       ///< the rotation, by the angular rates
  automatic  ///< odometry where there is one, else the inertial unit's, else none
};

/// Which camera, and which of a recording's frames and topics.
struct SourceOptions {
  std::string camera;  ///< a camera file or a name (fr1, fr2, fr3, bonn); empty = what the recording says, for a folder
                       ///< camera.yaml, else by the folder's name
  std::optional<Camera> fallback_camera;  ///< where none of these tells it
  /// Whoever opens a source checks: skip_pairs >= 0, start >= 0, end >= start, max_frames >= 1; throws InvalidOption.
  int64_t skip_pairs = 0;                                ///< left out at the beginning before all else
  double start = 0;                                      ///< [s] after the first pair's colour stamp, inclusive
  double end = std::numeric_limits<double>::infinity();  ///< [s] likewise, inclusive
  std::optional<int64_t> max_frames;                     ///< pairs counted from start
  bool threaded = true;                                  ///< decode ahead on a thread; the frames are the same
  /// Of recordings with several topics of a kind; empty = the only one there is.
  std::string colour_topic, depth_topic, info_topic, odom_topic, imu_topic;
  bool depth_limits = true;                ///< depth outside the camera's depth_min ... depth_max counts as missing
  PriorKind prior = PriorKind::automatic;  ///< of recordings that hold one
};

/// Opens what `where` names: a folder, a recording (.bag, .mcap, .db3 or its folder, .oni), or `KIND:PLACE` of a live
/// device. Throws InputError saying what is wrong and what to do; a kind that was not built in is named as such.
DKB_SLAM_API std::unique_ptr<Source> open_source(const std::string& where, const SourceOptions& options = {});

/// The folder `open_source` names, and nothing else: in the layout of the TUM RGB-D benchmark (associations.txt where
/// it is there, else rgb.txt and depth.txt) or in another that docs/sources.md lists, told apart by what lies in it;
/// colour as PNG or JPEG, depth as 16-bit PNG or 32-bit float. Throws InputError with file and line when the lists are
/// wrong, when none of the first five pairs can be read, or when one that can has another size than the camera. A pair
/// that cannot be read later on is skipped.
DKB_SLAM_API std::unique_ptr<Source> open_folder(const std::filesystem::path& folder,
                                                 const SourceOptions& options = {});

}  // namespace dkb
