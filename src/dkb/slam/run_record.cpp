// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/run_record.h"

#include <algorithm>
#include <map>
#include <utility>

#include "dkb/solver/pose_smoother.h"
#include "dkb/util/stamps.h"

namespace dkb {

void RunRecord::Records::add(const Record& record) {
  constexpr size_t kBlock = 256;
  if (last_.empty()) last_.reserve(kBlock);
  last_.push_back(record);
  if (last_.size() == kBlock) full_.push_back(std::make_shared<const std::vector<Record>>(std::exchange(last_, {})));
}

size_t RunRecord::Records::size() const {
  size_t size = last_.size();
  for (const auto& block : full_) size += block->size();
  return size;
}

void RunRecord::add(const TrackedFrame& frame, const FrameResult& result) {
  const std::lock_guard lock(mutex_);
  ++counts_.frames;
  for (const FeatureReport& f : result.features) counts_.features_removed += f.state == FeatureState::dynamic;
  counts_.lost += result.state == TrackingState::lost;
  if (!result.tracked()) return;
  ++counts_.tracked;
  counts_.predicted += result.state == TrackingState::predicted;
  counts_.relocalisations += result.state == TrackingState::relocalised;
  records_.add({frame.index, result.stamp_ns, frame.reference, frame.cam_from_reference, *result.world_from_cam,
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
  news_[stage] += ms;
}

void RunRecord::add_stages(const std::function<void(Statistics&)>& fill, const StageTimes& times) {
  const std::lock_guard lock(mutex_);
  fill(counts_);
  times_.merge(times);
  for (const StageTime& sum : times.sums()) news_[sum.stage] += sum.ms;
}

std::vector<StageTime> RunRecord::take_news() {
  const std::lock_guard lock(mutex_);
  std::vector<StageTime> news;
  news.reserve(news_.size());
  for (const auto& [stage, ms] : news_) news.push_back({stage, static_cast<float>(ms)});
  news_.clear();
  return news;
}

MapSnapshot RunRecord::map() const {
  const std::lock_guard lock(mutex_);
  return {map_.shared_view(), loops_};
}

std::vector<TrajectoryFrame> RunRecord::trajectory(TrajectoryKind kind) const {
  Records records;
  TrackingMap map;
  {
    // Tracking waits for this mutex: what takes time in a long run is done without it.
    const std::lock_guard lock(mutex_);
    records = records_;
    map = map_;
  }
  std::vector<TrajectoryFrame> frames;
  frames.reserve(records.size());
  std::map<int, std::vector<MeasuredPose>> by_map;
  const std::vector<int> map_of = map.view().map_of_each();
  const auto map_number_of = [&](KeyframeId reference) {
    const auto at = static_cast<size_t>(reference);
    // Mapping has not answered for the newest yet.
    return at < map_of.size() ? map_of[at] : map_number(map.view().roots(), map.root(reference));
  };
  struct Place {
    Rigid3 cam_from_world;
    int map = 0;
  };
  std::map<KeyframeId, Place> places;
  records.for_each([&](const Record& r) {
    auto [at, unknown] = places.try_emplace(r.reference);
    if (unknown) at->second = {map.cam_from_world(r.reference), map_number_of(r.reference)};
    const Rigid3 by_keyframe = (r.cam_from_reference * at->second.cam_from_world).inverse();
    frames.push_back(
        {r.frame, r.stamp_ns, kind == TrajectoryKind::online ? r.world_from_cam_online : by_keyframe, at->second.map});
    if (kind == TrajectoryKind::smoothed)
      by_map[frames.back().map].push_back(
          {seconds_from_ns(r.stamp_ns - frames.front().stamp_ns), by_keyframe, r.covariance.cast<double>()});
  });
  for (const auto& [number, measured] : by_map) {
    const std::vector<Rigid3> poses = smoothed_poses(measured);
    auto pose = poses.begin();
    for (TrajectoryFrame& f : frames)
      if (f.map == number) f.world_from_cam = *pose++;
  }
  return frames;
}

std::vector<TrajectoryFrame> RunRecord::keyframes() const {
  std::vector<TrajectoryFrame> frames;
  const MapView map = this->map().map();
  const std::vector<int> map_of = map->map_of_each();
  for (KeyframeId id : map->live_keyframes()) {
    const Keyframe& k = *map->keyframe(id);
    frames.push_back(
        {k.frame, ns_from_seconds(k.timestamp), k.cam_from_world.inverse(), map_of[static_cast<size_t>(id)]});
  }
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
  const std::vector<int> map_of = map_->map_of_each();
  std::vector<PointInfo> points;
  points.reserve(map_->point_count());
  for (PointId id : map_->live_points()) {
    const MapPoint& p = *map_->point(id);
    const int map = map_of[static_cast<size_t>(p.observations.front().keyframe)];
    points.push_back({id, p.position, p.colour, static_cast<int>(p.observations.size()), map});
  }
  return points;
}

std::vector<KeyframeInfo> MapSnapshot::keyframes() const {
  const std::vector<int> map_of = map_->map_of_each();
  std::vector<KeyframeInfo> keyframes;
  for (KeyframeId id : map_->live_keyframes()) {
    const Keyframe& k = *map_->keyframe(id);
    KeyframeInfo info{id, ns_from_seconds(k.timestamp),   k.frame, k.cam_from_world.inverse(),
                      {}, map_of[static_cast<size_t>(id)]};
    for (const Covisible& c : k.covisible) info.covisible.push_back({c.keyframe, c.shared_points});
    keyframes.push_back(std::move(info));
  }
  return keyframes;
}

}  // namespace dkb
