// SPDX-License-Identifier: Apache-2.0
// What the pipeline tells of a frame and of the run.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "dkb/slam/few_features.h"
#include "dkb/slam/pipeline.h"
#include "dkb/util/errors.h"
#include "dkb/util/plural.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr int kPatience = 30;  // [frames] without a map before that is told: about a second

// What depths an image has of those that the camera may tell.
std::string depths_text(const DepthImage& image, const Camera& camera) {
  float nearest = std::numeric_limits<float>::infinity(), farthest = 0;
  size_t known = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    const float z = image.data()[i];
    if (z > 0) ++known, nearest = std::min(nearest, z), farthest = std::max(farthest, z);
  }
  if (farthest == 0) return fmt::format("(no pixel has a depth of {:g} to {:g} m)", camera.depth_min, camera.depth_max);
  return fmt::format("({:.2g}% of the pixels have a depth, of {:.3g} to {:.3g} m{})",
                     100 * static_cast<double>(known) / static_cast<double>(image.size()), nearest, farthest,
                     farthest > 100 ? ": millimetres?" : "");
}

// Counted from 1, as in the names of files.
std::string new_map_text(int number) {
  if (number == 0) return "map 1 begins";
  return fmt::format("map {} begins; how its world lies to that of {} is not known until they are joined", number + 1,
                     number == 1 ? "map 1" : fmt::format("maps 1 to {}", number));
}

}  // namespace

void Pipeline::publish(const Scene& scene, const TrackedFrame& tracked, const KeyframeDecision& decision,
                       FrameResult& result) {
  const Frame& frame = scene.extracted.frame;
  result.frame = tracked.index;
  result.stamp_ns = frame.stamp_ns();
  result.state = tracked.state;
  result.detections = scene.boxes;
  result.mask = scene.mask;
  result.with_depth = tracked.with_depth;
  if (!tracked.tracked()) result.refused_inliers = tracked.refused_inliers;
  FrameOutcome outcome;
  if (result.tracked()) {
    const Rigid3 world_from_cam = tracked.cam_from_world.inverse();
    outcome.cam_from_world = tracked.cam_from_world;
    outcome.guessed = !tracked.tracked();
    // Where the images tell the pose again, the step is the prior's: what it was off by is the map's business.
    const bool seen_again = last_state_ == TrackingState::predicted && tracked.tracked();
    if (seen_again && tracked.predicted) {
      odometry_.update(tracked.predicted->cam_from_world.inverse(), false);
      outcome.found_world_from_guessed = world_from_cam * tracked.predicted->cam_from_world;
    }
    // How what was seen before the guesses lies to what is seen now is not known.
    if (seen_again && (tracked.starts_map || !tracked.predicted)) scenes_.forget_views();
    odometry_.update(world_from_cam, seen_again || (tracked.state == TrackingState::relocalised && tracked.index == 0));
    result.world_from_cam = world_from_cam;
    result.odom_from_cam = odometry_.odom_from_cam();
    // The frame in its map, and the map in its world. A frame that goes on where the images say nothing of how begins
    // a stretch of the map that is as uncertain as itself.
    const Matrix6d of_map = carried(tracked.cam_from_world, tracker_.map().covariance(tracked.reference));
    result.covariance = tracked.starts_map && tracked.predicted ? of_map : Matrix6d(tracked.covariance + of_map);
    result.reference_keyframe = tracked.reference;
    result.map = map_number(tracked.reference);
  }
  if (tracked.tracked()) {
    const Rigid3 world_from_cam = tracked.cam_from_world.inverse();
    result.inliers = tracked.inliers;
    result.keyframe = decision.insert;
    if (explain_keyframes_) result.keyframe_explanation = explained(decision);
    if (options_.dynamics.filter == FilterKind::standard) result.movers = movers_.finish(scene, world_from_cam);
  } else if (tracked.state == TrackingState::lost) {
    since_keyframe_.reset();  // what was told on the way here did not lead to where the camera will be found
    result.ambiguous = tracked.ambiguous;
    odometry_.lost();
  }
  result.world_from_odom = odometry_.world_from_odom();
  record_.add(tracked, result);
  const auto dynamic = std::count_if(scene.rejected.begin(), scene.rejected.end(),
                                     [](FeatureReason reason) { return reason != FeatureReason::none; });
  crowded_share_ =
      scene.rejected.empty() ? 0 : static_cast<double>(dynamic) / static_cast<double>(scene.rejected.size());
  note_changes(scene, tracked);
  if (decision.insert) note(Event::Kind::keyframe, rule_of(decision), tracked.reference);
  if (localize_only_) tracker_.make_report();  // nobody is told: the map stays as it is

  last_mask_ = scene.mask;
  outcome.keyframe = decision.insert;
  outcome.second_motion = tracked.second_motion;
  scenes_.learn(outcome);
  last_state_ = tracked.state;
  collect_times();
  ++next_frame_;
}

void Pipeline::note(Event::Kind kind, std::string text, int keyframe) {
  events_.push_back({kind, next_frame_, last_stamp_ns_, keyframe, std::move(text)});
}

void Pipeline::note_changes(const Scene& scene, const TrackedFrame& tracked) {
  // Where a prior tells how the camera came there, the old map goes on.
  if (tracked.starts_map && !tracked.predicted) note(Event::Kind::new_map, new_map_text(map_number(tracked.reference)));
  if (tracked.state == TrackingState::lost && last_state_ != TrackingState::lost) note(Event::Kind::lost);
  if (tracked.tracked() && last_state_ == TrackingState::lost) note(Event::Kind::found);
  if (tracked.state == TrackingState::initialising && !localize_only_) {
    most_corners_ = std::max(most_corners_, scene.extracted.orb.corners.size());
    if (++frames_before_map_ == kPatience)
      note(Event::Kind::warning, "tracking has not begun: none of the first " + std::to_string(kPatience) +
                                     " frames has " + std::to_string(options_.tracking.initial_points) +
                                     " features with depth" + remedy_without_features(scene));
  }
  // Before there is a map, the warning above says it.
  frames_without_depth_ = has_depth(scene.extracted.image().depth) ? 0 : frames_without_depth_ + 1;
  if (frames_without_depth_ == kPatience && !told_no_depth_ && tracked.state != TrackingState::initialising) {
    told_no_depth_ = true;
    note(Event::Kind::warning,
         "no depth: none of the last " + std::to_string(kPatience) +
             " frames has any, so that nothing new comes into the map; is the depth camera there, "
             "and its depth_factor right?");
  }
  if (tracked.state == TrackingState::initialising && localize_only_ && ++frames_without_map_ == kPatience)
    note(Event::Kind::warning, "there is no map to localise in; load one, or end localize_only to make one");
  for (std::string& warning : scenes_.take_warnings()) note(Event::Kind::warning, std::move(warning));
}

// What to do about frames of which too few features are left; `scene` is the last of them.
std::string Pipeline::remedy_without_features(const Scene& scene) const {
  std::string why =
      why_few_features(most_corners_, crowded_share_, scenes_.detector_kind(), options_.tracking.initial_points);
  if (!why.empty()) return why;
  const Camera& camera = context_.camera;
  return fmt::format("; are there depth images, in units of the camera's depth_factor ({:g} per metre)? ",
                     camera.depth_factor) +
         depths_text(scene.extracted.image().depth, camera);
}

// What runs beside tracking says how it is getting on.
void Pipeline::collect_times() {
  StageTimes times = mapping_.take_times();
  times.merge(loop_.take_times());
  times.merge(scenes_.take_times());
  const auto fill = [this](Statistics& s) {
    const MappingReport& report = mapping_.report();
    s.points_created = report.points_created;
    s.points_culled = report.points_culled;
    s.points_fused = report.points_fused;
    s.points_retracted = report.points_retracted;
    s.keyframes_culled = report.keyframes_culled;
    s.readout = timing_.camera().readout;
    s.depth_time_offset = timing_.camera().depth_time_offset;
    s.detector = scenes_.detector_kind();
    s.detector_rate_hz = scenes_.detector_rate_hz();
    s.detector_latency_frames = scenes_.detector_latency();
    s.detector_inference = scenes_.detector_inference();
    s.detector_failed = scenes_.detector_failed();
    if (load_) s.degraded_s = load_->seconds_by_name();
  };
  record_.add_stages(fill, times);
}

std::vector<Event> Pipeline::take_events() {
  return std::exchange(events_, {});
}

std::function<DenseMap()> Pipeline::dense_map_task(std::optional<int> map) const {
  if (!dense_) throw InputError("dense map: it was not asked for; set Options::dense_map");
  const std::vector<TrajectoryFrame> trajectory = record_.trajectory(TrajectoryKind::by_map);
  const int number = map ? *map : trajectory.empty() ? 0 : trajectory.back().map;
  std::vector<TimedPose> poses;
  for (const TrajectoryFrame& f : trajectory)  // maps that are not joined have worlds of their own
    if (f.map == number) poses.push_back({seconds_from_ns(f.stamp_ns), f.world_from_cam});
  return [dense = *dense_, poses = std::move(poses), seed = options_.seed, mount = options_.base_from_cam, number] {
    DenseMap made = dense.build(poses, seed, mount);
    made.map = number;
    if (made.grid) made.grid->map = number;
    return made;
  };
}

}  // namespace dkb
