// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/run_record.h"

#include <algorithm>

#include "dkb/solver/pose_smoother.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

// Maps are numbered by the age of their roots. A root that is not among them is newer than all.
int rank_of(const std::vector<KeyframeId>& roots, KeyframeId root) {
  return static_cast<int>(std::lower_bound(roots.begin(), roots.end(), root) - roots.begin());
}

}  // namespace

void RunRecord::add(const TrackedFrame& frame, const FrameResult& result, const TrackingMap& map) {
  const std::lock_guard lock(mutex_);
  map_ = map;
  ++counts_.frames;
  for (const FeatureReport& f : result.features) counts_.features_removed += f.state == FeatureState::dynamic;
  counts_.lost += result.state == TrackingState::lost;
  if (!result.tracked()) return;
  ++counts_.tracked;
  counts_.predicted += result.state == TrackingState::predicted;
  counts_.relocalisations += result.state == TrackingState::relocalised;
  records_.push_back({frame.index, result.stamp_ns, frame.reference, frame.cam_from_reference, *result.world_from_cam,
                      frame.covariance.cast<float>()});
}

void RunRecord::add(const KeyframeTests& tests) {
  const std::lock_guard lock(mutex_);
  tests_.add(tests);
}

void RunRecord::add(KeyframeRule rule) {
  const std::lock_guard lock(mutex_);
  ++counts_.keyframes_inserted;
  ++counts_.keyframe_rules[name_of(rule)];
}

void RunRecord::add(const LoopInfo& loop) {
  const std::lock_guard lock(mutex_);
  loops_.push_back(loop);
  ++(loop.merge ? counts_.merges : counts_.loops);
}

void RunRecord::set_map(const TrackingMap& map) {
  const std::lock_guard lock(mutex_);
  map_ = map;
}

void RunRecord::add_time(const std::string& stage, double ms) {
  const std::lock_guard lock(mutex_);
  times_.add(stage, ms);
  news_.add(stage, ms);
}

void RunRecord::add_stages(const std::function<void(Statistics&)>& fill, const StageTimes& times) {
  const std::lock_guard lock(mutex_);
  fill(counts_);
  times_.merge(times);
  news_.merge(times);
}

std::vector<StageTime> RunRecord::take_news() {
  const std::lock_guard lock(mutex_);
  return news_.take().sums();
}

MapSnapshot RunRecord::map() const {
  const std::lock_guard lock(mutex_);
  return {map_.shared_view(), loops_};
}

std::vector<TrajectoryFrame> RunRecord::trajectory(TrajectoryKind kind) const {
  std::vector<TrajectoryFrame> frames;
  std::map<int, std::vector<MeasuredPose>> by_map;
  {
    const std::lock_guard lock(mutex_);
    const std::vector<KeyframeId> roots = map_.view().roots();
    frames.reserve(records_.size());
    for (const Record& r : records_) {
      const Rigid3 by_keyframe = (r.cam_from_reference * map_.cam_from_world(r.reference)).inverse();
      frames.push_back({r.frame, r.stamp_ns, kind == TrajectoryKind::online ? r.world_from_cam_online : by_keyframe,
                        rank_of(roots, map_.root(r.reference))});
      if (kind == TrajectoryKind::smoothed)
        by_map[frames.back().map].push_back(
            {seconds_from_ns(r.stamp_ns - records_[0].stamp_ns), by_keyframe, r.covariance.cast<double>()});
    }
  }
  for (const auto& [map, measured] : by_map) {
    const std::vector<Rigid3> poses = smoothed_poses(measured);
    auto pose = poses.begin();
    for (TrajectoryFrame& f : frames)
      if (f.map == map) f.world_from_cam = *pose++;
  }
  return frames;
}

std::vector<TrajectoryFrame> RunRecord::keyframes() const {
  std::vector<TrajectoryFrame> frames;
  for (const KeyframeInfo& k : map().keyframes()) frames.push_back({k.frame, k.stamp_ns, k.world_from_cam, k.map});
  return frames;
}

Statistics RunRecord::statistics() const {
  Statistics s;
  StageTimes times;
  {
    const std::lock_guard lock(mutex_);
    s = counts_;
    s.keyframe_tests = tests_.by_name();
    s.keyframes = map_.view().live_keyframe_count();
    s.maps = static_cast<int>(map_.view().roots().size());
    s.map_points = map_.view().point_count();
    times = times_;
  }
  // Tracking goes on while quantiles are read.
  s.stages = times.summaries();
  s.stage_histograms = times.histograms();
  return s;
}

MapSnapshot::MapSnapshot() : map_(std::make_shared<const Map>()) {}
MapSnapshot::MapSnapshot(std::shared_ptr<const Map> map, std::vector<LoopInfo> loops)
    : map_(std::move(map)), loops_(std::move(loops)) {}

size_t MapSnapshot::point_count() const {
  return map_->point_count();
}
int MapSnapshot::keyframe_count() const {
  return map_->live_keyframe_count();
}

std::vector<PointInfo> MapSnapshot::points() const {
  std::vector<PointInfo> points;
  points.reserve(map_->point_count());
  for (PointId id : map_->live_points()) {
    const MapPoint& p = *map_->point(id);
    points.push_back({id, p.position, p.colour, static_cast<int>(p.observations.size())});
  }
  return points;
}

std::vector<KeyframeInfo> MapSnapshot::keyframes() const {
  const std::vector<KeyframeId> roots = map_->roots();
  std::vector<KeyframeInfo> keyframes;
  for (KeyframeId id : map_->live_keyframes()) {
    const Keyframe& k = *map_->keyframe(id);
    KeyframeInfo info{id, ns_from_seconds(k.timestamp), k.frame, k.cam_from_world.inverse(), {}, 0};
    info.map = rank_of(roots, map_->root(id));
    for (const Covisible& c : k.covisible) info.covisible.push_back({c.keyframe, c.shared_points});
    keyframes.push_back(std::move(info));
  }
  return keyframes;
}

}  // namespace dkb
