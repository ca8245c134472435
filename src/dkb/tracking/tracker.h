// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "dkb/geometry/motion_model.h"
#include "dkb/map/keyframe_packet.h"
#include "dkb/map/map.h"
#include "dkb/matching/candidates.h"
#include "dkb/matching/optics.h"
#include "dkb/solver/pose_optimiser.h"
#include "dkb/tracking/frame.h"
#include "dkb/tracking/local_map.h"
#include "dkb/tracking/odometry_points.h"
#include "dkb/tracking/relocaliser.h"
#include "dkb/tracking/tracking_map.h"
#include "dkb/tracking/visibility_counts.h"

namespace dkb {

struct TrackingOptions {
  int initial_points = 100;  // features with depth that the first frame of a map needs, >= 10
  int min_inliers = 20;      // inliers of the final pose; fewer: lost, >= 6
  double close_depth = 6.0;  // [m] depths below make map points at once, > 0
  double new_map_after = 1;  // [s] lost in frames good enough to start a map, until one is; 0 = never
};

// A map point where a pose puts it.
struct PointInView {
  PointId id = kNoPoint;
  Eigen::Vector2d image_pixel;  // [px] as read
  double depth = 0;             // [m]
};

// Frames in a row that showed nothing of the map.
struct LostFrames {
  double at = 0;                // [s] the last of them
  std::optional<double> since;  // [s] the first that could have started a map; later for those that could not
};

// Frame to pose, against an immutable view of the map and the tracker's own provisional points.
// Deterministic: the same frames and views in the same order give the same poses.
class Tracker {
 public:
  Tracker(const Optics& optics, const TrackingOptions& options, uint64_t seed);

  // A newer view: the last pose is re-expressed through its reference keyframe. Returns how the world moved under the
  // camera: new_world_from_old_world.
  Rigid3 take_view(MapView view);
  const TrackingMap& map() const { return map_; }

  // Motion from the last frame to one at `timestamp`: what `prior` tells, and for what it does not tell the velocity.
  // Nothing without a last frame.
  std::optional<MotionPrior> expected_step(double timestamp, const MotionPrior* prior) const;
  // [m/s, rad/s] tangent of later_cam_from_earlier_cam over one second; zero while unknown.
  Vector6d velocity() const { return velocity_.value_or(VelocityFilter{}).velocity(); }

  // The frame's features are made for the expected velocity, and again for the one that the first pose shows.
  TrackedFrame track(const TrackingInput& input);

  // Makes the packet of a new keyframe from the frame just tracked; its points are known to tracking from now on.
  KeyframePacket make_keyframe(KeyframeId id, const TrackedFrame& frame);
  // The first keyframe of a map as it is after TrackedFrame::start_features.
  void remake(const TrackedFrame& next, KeyframePacket& packet) const;
  // What is left to report when no keyframe follows.
  KeyframePacket make_report();

  // These points move: they are matched no more, and mapping is told with the next packet.
  void retract(const std::vector<PointId>& points);
  // The map points near the last frame that its pose puts in view.
  std::vector<PointInView> points_in_view() const;
  const std::optional<PosedFrame>& last_frame() const { return last_; }

  // Points of the reference keyframe that another keyframe sees as well; all of them where a map begins.
  int reference_point_count(KeyframeId reference) const;
  // Position of a point that tracking may match, in the world; nothing when it is gone.
  std::optional<Eigen::Vector3d> position(PointId id) const;
  std::vector<std::optional<Eigen::Vector3d>> positions(const std::vector<PointId>& points) const;
  // Forgets velocity and the last frame, so that the next frame is found anew in the map.
  void reset_motion();
  // Somebody says where the camera is: the next frames are sought there first, until one is found.
  void suggest(const PosePrediction& pose);
  // Where the camera of the very first map stands; later ones start where it was seen last or suggested to be.
  void set_start(const Rigid3& cam_from_world) { start_ = cam_from_world; }

 private:
  static constexpr int kMatchDistance = 90;  // [bits] largest Hamming distance of a match with a map point

  struct Pair {
    int feature = -1;
    Eigen::Vector3d point_in_world;
    double weight = 1;  // in a pose
    bool use_depth = true;
    double parallax_sigma = 0;  // [px] by not knowing the depth
  };
  Pair odometry_pair(int feature, const OdometryMatch& match, const Rigid3& cam_from_world) const;
  // Of a pair's pixel, over the variance of a corner in one frame.
  double squared_error(const Pair& pair, const Rigid3& cam_from_world, const RgbdFeatures& features) const;
  double forget_strays(const std::vector<Pair>& pairs, size_t first, const PoseEstimate& pose,
                       const RgbdFeatures& features, std::vector<std::optional<OdometryMatch>>& followed) const;
  PoseEstimate refine(const Rigid3& initial, const std::vector<Pair>& pairs, const RgbdFeatures& features,
                      const std::optional<PosePrediction>& expected) const;
  // [px] search for local map points under the first pose; no less than what corners of whole pixels need.
  double radius_local_map() const { return std::max(4.0, optics_.pixels(4)); }
  // [px] search around the motion model's prediction: 19 mrad, whatever the camera's resolution.
  double radius_last_frame() const { return std::max(radius_local_map(), std::round(optics_.pixels(10))); }
  std::vector<Candidate> points_shown_last() const;
  bool track_from_last(TrackedFrame& frame, const TrackingInput& input);
  bool track_among_suspects(TrackedFrame& frame, const TrackingInput& input);
  bool track_expected(const PosePrediction& expected, TrackedFrame& frame);
  // Since the last frame: what any camera may do, and what this one may by its velocity, where that is known.
  bool possible_motion(const Rigid3& cam_from_world, double timestamp) const;
  bool plausible_motion(const Rigid3& cam_from_world, double timestamp) const;
  PosePrediction pose_after(const MotionPrior& step) const;  // since the last frame
  // By the velocity alone; nothing where none is known.
  std::optional<PosePrediction> pose_by_velocity(double timestamp) const;
  std::optional<PosePrediction> predict(const TrackingInput& input) const;
  void go_on_unseen(const std::optional<PosePrediction>& prediction, const MotionPrior* told, TrackedFrame& frame);
  double reach_px(double radius, const Matrix6d& covariance) const;
  std::vector<double> widening_radii(const Matrix6d& covariance) const;
  std::optional<PoseProposal> find_near(const PosePrediction& expected, const MatchableFeatures& features) const;
  std::optional<PoseProposal> find_where_lost(const TrackedFrame& frame) const;
  bool relocalise(TrackedFrame& frame, PointAppearance* appearance, const PosePrediction* expected);
  bool confirm_relocalisation(TrackedFrame& frame, const TrackingInput& input);
  Rigid3 express_anew(PosedFrame& frame) const;
  bool start_map(TrackedFrame& frame, const PosePrediction* expected);
  // `accept`: what else a pose must fulfil; may be empty.
  bool track_local_map(const Rigid3& initial, double radius, int min_inliers, std::vector<PointId>& points,
                       TrackedFrame& frame, const std::function<bool(const PoseEstimate&)>& accept = {});
  bool is_retracted(PointId id) const;
  void refresh_candidates(const std::vector<PointId>& points, double now);
  std::vector<uint8_t> candidates_to_skip(const std::vector<PointId>& matched) const;
  VelocityFilter velocity_by(const TrackedFrame& frame) const;
  bool refine_at_velocity(const Vector6d& velocity, const FrameFeatures& features, TrackedFrame& frame) const;
  struct TwoMotions;
  std::optional<TrackedFrame> found_around(const PosePrediction& expected, const FrameFeatures& features,
                                           const TrackedFrame& frame);
  std::optional<TwoMotions> two_motions(const TrackedFrame& frame, const FrameFeatures& features,
                                        const std::optional<PosePrediction>& by_velocity);
  void leave_out_mover(const FrameFeatures& features, TrackedFrame& frame);
  void remake_start(std::shared_ptr<const RgbdFeatures> features, TrackedFrame& next);
  bool established(PointId id, double now) const;
  static void drop_unmatched_suspects(TrackedFrame& frame);
  void finish(TrackedFrame& frame);

  Optics optics_;
  TrackingOptions options_;
  uint64_t seed_;
  Relocaliser relocaliser_;
  Rigid3 start_;  // cam_from_world

  TrackingMap map_;
  std::map<PointId, ProvisionalPoint> provisional_;
  VisibilityCounts visibility_;
  std::vector<PointId> retracted_;   // increasing; until the view has dropped them
  std::vector<PointId> unreported_;  // of these, what mapping was not told yet

  TrackingState state_ = TrackingState::initialising;
  std::optional<PosedFrame> last_;           // last frame with a pose
  OdometryPoints odometry_;                  // from the last frame
  PlaceEvidence place_evidence_;             // of the frames since the camera was lost
  std::optional<PosedFrame> unconfirmed_;    // where the frame before was found again, to be confirmed
  std::optional<VelocityFilter> velocity_;   // nothing while nobody knows it
  double last_seen_ = 0;                     // [s] when the images told the pose last
  std::optional<PosePrediction> suggested_;  // by the user
  std::optional<LostFrames> lost_;           // nothing while the map is seen
  std::vector<Candidate> candidates_;        // from the view, then of provisional points; either by increasing id
  size_t from_view_ = 0;                     // of these, the first
  std::optional<double> candidates_made_;    // [s] nothing = the view is newer
};

}  // namespace dkb
