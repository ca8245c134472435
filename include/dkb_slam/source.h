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
  /// How many pairs there are, where that is known.
  virtual std::optional<size_t> size() const { return std::nullopt; }
  /// For people: what is read, and by which list.
  virtual std::string description() const = 0;
};

/// Which camera, and which of a recording's pairs.
struct FolderOptions {
  std::string camera;  ///< a camera file or a name (fr1, fr2, fr3, bonn); empty = camera.yaml in the folder, else by
                       ///< the folder's name
  std::optional<Camera> fallback_camera;                 ///< where none of these tells it
  int64_t skip_pairs = 0;                                ///< left out at the beginning before all else
  double start = 0;                                      ///< [s] after the first pair's colour stamp, inclusive
  double end = std::numeric_limits<double>::infinity();  ///< [s] likewise, inclusive
  std::optional<int64_t> max_frames;                     ///< pairs counted from start
  bool threaded = true;                                  ///< decode ahead on a thread; the frames are the same
};

/// A sequence in the layout of the TUM RGB-D benchmark: associations.txt where it is there, else rgb.txt and depth.txt;
/// colour as PNG or JPEG, depth as 16-bit PNG or 32-bit float. Throws InputError with file and line when the lists are
/// wrong, when none of the first five pairs can be read, or when one that can has another size than the camera.
/// A pair that cannot be read later on is skipped.
DKB_SLAM_API std::unique_ptr<Source> open_folder(const std::filesystem::path& folder,
                                                 const FolderOptions& options = {});

}  // namespace dkb
