// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where frames come from: the interface for sources of one's own, and recorded folders; and what wheels and gyroscopes
/// tell of the motion between them.
#pragma once

#include <cstdint>
#include <deque>
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

/// What odometry tells at one time: nav_msgs/Odometry. A variance that is 0, negative or not finite is not known.
struct OdometrySample {
  int64_t stamp_ns = 0;                        ///< rises from sample to sample
  Rigid3 pose;                                 ///< of the body in a frame that stands still
  Vector6d twist = Vector6d::Zero();           ///< [v m/s, w rad/s] in the body's axes; not finite = not known
  Vector6d pose_variance = Vector6d::Zero();   ///< [m^2, rad^2] of x, y, z and about them, that frame's axes
  Vector6d twist_variance = Vector6d::Zero();  ///< of the twist, [(m/s)^2, (rad/s)^2]
};

/// What a gyroscope tells at one time: sensor_msgs/Imu.
struct GyroSample {
  int64_t stamp_ns = 0;                    ///< rises from sample to sample
  Eigen::Vector3d rate{0, 0, 0};           ///< [rad/s] angular velocity in the sensor's axes
  Eigen::Vector3d rate_variance{0, 0, 0};  ///< [(rad/s)^2] as above; x below 0 marks a unit without a gyroscope
};

/// The newest samples of one sensor that is fixed to the camera, odometry or a gyroscope; answers with the motion of
/// its body between two times. Deterministic: by the samples and their order alone. Keeps 20,000 samples at most. One
/// thread at a time.
class DKB_SLAM_API MotionHistory {
 public:
  /// `drift`: the share of ten metres that odometry without variances is off by, 0 ... 1. A shorter way is off by more:
  /// its standard deviation grows with the root of it. Throws InvalidOption.
  explicit MotionHistory(double drift = 0.01);

  /// False: the sample is left out, since its stamp is not after the newest one's, or its pose or its rates are none,
  /// or samples of the other kind are held. After ten stamps in a row that do not rise the clock is taken to have been
  /// set back, or one stamp to have been far ahead: it goes on from there.
  bool add(const OdometrySample& sample);
  bool add(const GyroSample& sample);  ///< likewise
  /// Begins anew; samples of either kind may follow.
  void clear();
  /// The newest sample is of this time or later.
  bool reaches(int64_t stamp_ns) const { return !samples_.empty() && samples_.back().stamp_ns >= stamp_ns; }
  /// Drops what is not needed for times from this one on.
  void forget_before(int64_t stamp_ns);

  /// The motion from one time to a later one, and its covariance, in the body's axes: moved_to_camera() makes it the
  /// camera's. Nothing where samples are missing, and for motions that nothing can make.
  ///
  /// Odometry: poses are interpolated over at most 0.5 s, and carried on by a twist that is known for at most 0.1 s
  /// after the newest. The variance in each direction is the growth of the pose's; else, where that tells nothing, the
  /// twist's; else that of the drift, and for the heading of 1% of ten radians besides; 1 mm and 1 mrad are added, and
  /// more than 1 m^2 or rad^2 is as good as unknown.
  ///
  /// Gyroscope: the rotation alone, by rates that change evenly between samples at most 0.1 s apart; for as long the
  /// newest one holds. Its variance is the rates', or (0.01 rad/s)^2, times the square of the duration, and 1 mrad.
  std::optional<MotionPrior> between(int64_t from_ns, int64_t to_ns) const;

 private:
  bool take(const OdometrySample& sample, bool rates);

  double drift_;
  bool rates_ = false;                  // the twists' rotations are a gyroscope's, and there are no poses
  int refused_ = 0;                     // stamps in a row that did not rise
  std::deque<OdometrySample> samples_;  // by stamp
};

/// The motion of a body that is fixed to the camera, as the camera's: both in their own axes.
DKB_SLAM_API MotionPrior moved_to_camera(const MotionPrior& prior, const Rigid3& cam_from_body);

}  // namespace dkb
