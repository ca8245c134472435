// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_history.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace dkb {

void SessionHistory::add(FrameFact fact) {
  if (!first_stamp_) first_stamp_ = fact.stamp_ns;
  add_stages(fact);
  fact.stages.clear();
  facts_.push_back(fact);
  if (facts_.size() > kFacts) {
    facts_.pop_front();
    ++facts_gone_;
  }
  if (fact.host == kNoKeyframe) {
    if (!path_.empty() && path_.back().host != kNoKeyframe) path_.push_back({fact.frame, fact.stamp_ns});
    return;
  }
  if (last_on_path_ && last_on_path_->host == fact.host && path_.back().host != kNoKeyframe &&
      (last_on_path_->position_in_host - fact.position_in_host).norm() < spacing_)
    return;
  last_on_path_ = fact;
  path_.push_back({fact.frame, fact.stamp_ns, fact.host, fact.position_in_host});
  if (path_.size() < kPath) return;
  // Every second point goes; where the path is broken it stays so.
  size_t kept = 0, points = 0;
  for (const PathPoint& p : path_) {
    const bool broken = p.host == kNoKeyframe;
    // Of breaks that have no point between them any more one is left: a third of all goes at least.
    const bool stays = broken ? kept > 0 && path_[kept - 1].host != kNoKeyframe : points++ % 2 == 0;
    if (stays) path_[kept++] = p;
  }
  path_.resize(kept);
  spacing_ *= 2;
  ++path_generation_;
}

void SessionHistory::add_stages(const FrameFact& fact) {
  StagesOfFrame of{fact.frame, {}};
  for (const StageTime& s : fact.stages) {
    auto name = std::find(stage_names_.begin(), stage_names_.end(), s.stage);
    if (name == stage_names_.end()) name = stage_names_.insert(name, s.stage);
    of.times.emplace_back(static_cast<uint16_t>(name - stage_names_.begin()),
                          static_cast<uint16_t>(std::clamp(50 * s.ms, 0.0F, 65535.0F)));
  }
  if (of.times.empty()) return;
  stages_.push_back(std::move(of));
  if (stages_.size() <= kStages) return;
  stages_.pop_front();
  ++stages_gone_;
}

void SessionHistory::write_stages(Client& client, StreamWriter& out) const {
  if (client.stage_names < stage_names_.size()) {
    client.stage_names = stage_names_.size();
    out.message(StreamMessage::stage_names, [&](StreamWriter& m) { m.put_bytes(nlohmann::json(stage_names_).dump()); });
  }
  client.stages = std::max(client.stages, stages_gone_);
  out.message(StreamMessage::stages, [&](StreamWriter& m) {
    for (; client.stages - stages_gone_ < stages_.size(); ++client.stages) {
      const StagesOfFrame& of = stages_[client.stages - stages_gone_];
      m.put(static_cast<uint32_t>(of.frame));
      m.put(static_cast<uint32_t>(of.times.size()));
      for (const auto& [stage, time] : of.times) {
        m.put(stage);
        m.put(time);
      }
    }
  });
}

void SessionHistory::add(SessionEvent event) {
  events_.push_back(std::move(event));
  if (events_.size() <= kEvents) return;
  events_.pop_front();
  ++events_gone_;
}

double SessionHistory::seconds_of(int64_t stamp_ns) const {
  return first_stamp_ ? static_cast<double>(stamp_ns - *first_stamp_) * 1e-9 : 0;
}

void SessionHistory::clear_path() {
  path_.clear();
  last_on_path_.reset();
  ++path_generation_;
}

void SessionHistory::write(Client& client, StreamWriter& out, int keyframes) const {
  out.message(StreamMessage::facts, [&](StreamWriter& m) {
    client.facts = std::max(client.facts, facts_gone_);
    for (; client.facts - facts_gone_ < facts_.size(); ++client.facts) {
      const FrameFact& f = facts_[client.facts - facts_gone_];
      m.put(static_cast<uint32_t>(f.frame));
      m.put(f.tracking_ms);
      m.put(static_cast<float>(seconds_of(f.stamp_ns)));
      m.put(f.inliers);
      m.put(static_cast<uint8_t>(f.state));
      m.put<uint8_t>(f.made_keyframe ? 1 : 0);
    }
  });
  write_stages(client, out);
  if (client.path_generation != path_generation_) {
    if (client.path_generation != 0) out.empty_message(StreamMessage::path_reset);
    client.path_generation = path_generation_;
    client.path = 0;
  }
  out.message(StreamMessage::path, [&](StreamWriter& m) {
    for (; client.path < path_.size() && path_[client.path].host < keyframes; ++client.path) {
      const PathPoint& p = path_[client.path];
      m.put(static_cast<uint32_t>(p.frame));
      m.put<int32_t>(p.host);
      for (int i = 0; i < 3; ++i) m.put(static_cast<float>(p.position[i]));
    }
  });
  client.events = std::max(client.events, events_gone_);
  if (client.events - events_gone_ < events_.size()) {
    nlohmann::json list = nlohmann::json::array();
    for (; client.events - events_gone_ < events_.size(); ++client.events) {
      const SessionEvent& e = events_[client.events - events_gone_];
      list.push_back({{"kind", e.kind}, {"frame", e.frame}, {"text", e.text}, {"time", seconds_of(e.stamp_ns)}});
    }
    out.message(StreamMessage::events, [&](StreamWriter& m) {
      m.put_bytes(list.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    });
  }
}

KeyframeId SessionHistory::current_root(const Map& map) const {
  for (auto p = path_.rbegin(); p != path_.rend(); ++p)
    if (p->host != kNoKeyframe && p->host < map.keyframe_count()) return map.root(p->host);
  return kNoKeyframe;
}

std::optional<Rigid3> SessionHistory::world_from_truth(const Map& map,
                                                       const std::vector<ViewerOptions::TruePosition>& truth) const {
  constexpr int64_t kMaxDifference = 20'000'000;  // [ns]
  const std::vector<KeyframeId> roots = map.root_of_each();
  const KeyframeId root = current_root(map);
  std::vector<Eigen::Vector3d> from, to;
  for (const PathPoint& p : path_) {
    if (p.host == kNoKeyframe || p.host >= map.keyframe_count() || roots[static_cast<size_t>(p.host)] != root) continue;
    auto after = std::lower_bound(truth.begin(), truth.end(), p.stamp_ns,
                                  [](const auto& t, int64_t stamp) { return t.stamp_ns < stamp; });
    if (after != truth.begin() &&
        (after == truth.end() || p.stamp_ns - std::prev(after)->stamp_ns < after->stamp_ns - p.stamp_ns))
      --after;
    if (after == truth.end() || std::abs(after->stamp_ns - p.stamp_ns) > kMaxDifference) continue;
    from.push_back(after->position);
    to.push_back(map.cam_from_world(p.host).inverse() * p.position);
  }
  if (from.size() < 10) return std::nullopt;
  return align_umeyama(from, to, false).motion;
}

}  // namespace dkb
