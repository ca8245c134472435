// SPDX-License-Identifier: Apache-2.0
/// \file
/// What goes in for every frame, and what comes out.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/detector.h"
#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

struct RgbdImage;  // the library's own

/// What something else knows of the camera's motion since the frame before: wheels, an inertial unit, a planner. It
/// guides the search for the frame's pose; the images have the last word.
struct MotionPrior {
  Rigid3 previous_from_current;                ///< camera axes; of the frame that process() took last and this one
  bool rotation_only = false;                  ///< the translation is not known
  Matrix6d covariance = Matrix6d::Identity();  ///< right perturbation, [translation m, rotation rad], camera axes
};

/// The motion of two priors, one after the other: what a consumer needs that leaves out the frame between them. The
/// covariances add up, that of the first in the axes of the second.
DKB_SLAM_API MotionPrior joined(const MotionPrior& first, const MotionPrior& second);

/// A pair of images as the caller has them. The views are read during the call and may be gone after it.
struct FrameInput {
  int64_t stamp_ns = 0;   ///< of the colour image, middle of the exposure; rises from frame to frame
  ImageView colour = {};  ///< rgb8, bgr8, rgba8, bgra8 or grey8, of the camera's size
  ImageView depth = {};   ///< depth_u16 or depth_f32, of the same size, registered to the colour camera
  std::optional<int64_t> depth_stamp_ns = {};  ///< of the depth image, within 0.2 s; nothing = the colour image's
  std::optional<MotionPrior> prior = {};       ///< where something else knows of the motion since the last frame taken
};

/// A pair of images, checked, copied and never changed again. Copies of it share the images. A frame may be made on
/// another thread than the one that feeds it to Slam, so that converting costs the tracking thread nothing.
class DKB_SLAM_API Frame {
 public:
  Frame() = default;  ///< empty
  /// Throws InputError when an image is missing, has another size than the camera, a stride below its width, or a
  /// format that does not fit, when the stamps are more than 0.2 s apart, and when the prior is none: see set_prior().
  Frame(const Camera& camera, const FrameInput& input);
  /// The library's own readers enter here.
  explicit Frame(std::shared_ptr<const RgbdImage> image, int64_t stamp_ns, int64_t depth_stamp_ns);

  bool empty() const { return image_ == nullptr; }            ///< it holds no images
  int64_t stamp_ns() const { return stamp_ns_; }              ///< of the colour image
  int64_t depth_stamp_ns() const { return depth_stamp_ns_; }  ///< of the depth image
  const std::optional<MotionPrior>& prior() const { return prior_; }
  /// Throws InputError, and leaves the prior as it was, when one of its numbers is not finite, the length of its
  /// quaternion is more than 1e-3 off 1, or its covariance is not symmetric or has a negative variance in some
  /// direction.
  void set_prior(const std::optional<MotionPrior>& prior);
  ImageView colour() const;  ///< rgb8; empty for grey cameras. Valid as long as a copy of the frame lives
  ImageView grey() const;    ///< grey8, likewise
  ImageView depth() const;   ///< depth_f32, likewise
  const std::shared_ptr<const RgbdImage>& image() const { return image_; }  ///< the library's own

 private:
  std::shared_ptr<const RgbdImage> image_;
  int64_t stamp_ns_ = 0, depth_stamp_ns_ = 0;
  std::optional<MotionPrior> prior_;
};

/// What tracking made of a frame.
enum class TrackingState {
  initialising,  ///< no map yet
  tracking,      ///< the pose is good
  lost,          ///< there is no pose
  relocalised,   ///< found again; the pose is good
  paused,        ///< Slam::pause(true): the frame was not looked at
  predicted,     ///< the images do not tell; the pose goes on by a motion prior or by depth, and the covariance grows
};
DKB_SLAM_API const char* name_of(TrackingState state);

/// Something that moves by itself, as seen in one frame: an obstacle for a planner.
struct Mover {
  int id = 0;                                  ///< the same in all frames of one run, from 1
  std::string class_name;                      ///< the detector's; "object" when no detector knows it
  Eigen::Vector3d position_in_world{0, 0, 0};  ///< [m] median of its visible surface points, per coordinate
  Eigen::Vector3d velocity_in_world{0, 0, 0};  ///< [m/s]
  double position_sd = 0;                      ///< [m] standard deviation of each coordinate of the position
  Matrix6d covariance = Matrix6d::Zero();      ///< of [position m, velocity m/s] in the world
  Eigen::Vector3d size{0, 0, 0};  ///< [m] of what is visible: width, height, depth, along the camera's axes
  Box box;                        ///< [px] of the original image
  bool operator==(const Mover&) const = default;
};

/// What became of a feature.
enum class FeatureState : uint8_t {
  unused,   ///< nothing was matched with it
  used,     ///< inlier of the pose, or it made or extended a map point
  outlier,  ///< matched, but the pose does not explain it
  dynamic,  ///< it may lie on something that moves
};
DKB_SLAM_API const char* name_of(FeatureState state);

/// Why a feature was rejected.
enum class FeatureReason : uint8_t {
  none,       ///< it was not
  on_mover,   ///< it lies where a detector or the motion segmentation sees a mover
  moved,      ///< it moved in a way that the camera's own motion does not explain (the filters of other systems)
  disagrees,  ///< its place or depth is off from the point that it was matched with
};
DKB_SLAM_API const char* name_of(FeatureReason reason);

/// One feature that a frame extracted.
struct FeatureReport {
  float image_x = 0, image_y = 0;              ///< [px] of the original image, distortion and all
  FeatureState state = FeatureState::unused;   ///< what became of it
  FeatureReason reason = FeatureReason::none;  ///< of state `outlier` or `dynamic`
};

/// Durations of one stage, by the steady clock.
struct StageSummary {
  double mean_ms = 0, median_ms = 0, p95_ms = 0, max_ms = 0;  ///< [ms] median and p95 within 0.5%
  size_t count = 0;                                           ///< how often it ran
};

/// How long a stage took.
struct StageTime {
  std::string stage;  ///< as in Statistics::stages
  float ms = 0;       ///< [ms] by the steady clock
};

/// Everything of one frame.
struct FrameResult {
  int frame = 0;                                      ///< counts accepted frames from 0; paused: the last one's
  int64_t stamp_ns = 0;                               ///< the input's
  TrackingState state = TrackingState::initialising;  ///< what the rest may be used for
  /// Lost, though the map has a place that looks like this one: it may be another. More views decide.
  bool ambiguous = false;
  /// Without a pose by the images: map points that agree with the best one that was found and refused.
  int refused_inliers = 0;
  /// The pose. Camera axes: x right, y down, z forward. World: the first tracked camera, or the robot's base there
  /// (Options::base_from_cam). There is a pose when tracked().
  std::optional<Rigid3> world_from_cam;
  std::optional<Rigid3> odom_from_cam;  ///< smooth: does not jump when the map is corrected; steer by this
  /// Of world_from_cam: right perturbation, [translation m, rotation rad]. The frame's in the map, and the map's own
  /// there against the world's origin; a map that was loaded is taken for the truth.
  std::optional<Matrix6d> covariance;
  int map = 0;             ///< as TrajectoryFrame::map: other than 0, how its world lies to the first's is not known
  Rigid3 world_from_odom;  ///< takes the jumps; world_from_cam = world_from_odom * odom_from_cam
  int inliers = 0;         ///< map points that the pose rests on
  int reference_keyframe = -1;          ///< the keyframe that shows most of them
  std::vector<Mover> movers;            ///< seen in this frame, by id; told by FilterKind::standard alone
  std::vector<Detection> detections;    ///< boxes of the detectors, carried to this image
  MoverMask mask;                       ///< where movers are in this image
  std::vector<FeatureReport> features;  ///< every feature that was extracted, people's included
  int with_depth = 0;                   ///< of these with depth, those on movers left out: a map begins with them
  bool keyframe = false;                ///< the frame became a keyframe
  std::string keyframe_explanation;     ///< why, or why not; empty unless Slam::explain_keyframes(true)
  double tracking_ms = 0;               ///< steady clock: own work on this frame
  double waiting_ms = 0;                ///< for mapping and the detector; 0 in a real-time run, but for the first frame
  std::vector<StageTime> stages;        ///< this frame's, and what other threads have finished since the last

  /// There is a pose.
  bool tracked() const {
    return state == TrackingState::tracking || state == TrackingState::relocalised || state == TrackingState::predicted;
  }
};

}  // namespace dkb
