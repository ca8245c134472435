// SPDX-License-Identifier: Apache-2.0
// Map::restore: everything that the rest of Map takes for granted is checked here, once, for maps that come from
// outside.
#include <algorithm>
#include <numeric>
#include <string>

#include "dkb/map/map.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

[[noreturn]] void contradiction(const std::string& what) {
  throw InputError(what);
}

std::string keyframe_name(KeyframeId id) {
  return "keyframe " + std::to_string(id);
}
std::string point_name(PointId id) {
  return "point " + std::to_string(id);
}

void check_parts(const std::vector<Keyframe>& keyframes, KeyframeId expected) {
  const Keyframe& k = keyframes[static_cast<size_t>(expected)];
  const auto count = static_cast<KeyframeId>(keyframes.size());
  if (k.id != expected) contradiction(keyframe_name(k.id) + " stands where " + keyframe_name(expected) + " should");
  if (k.parent < kNoKeyframe || k.parent >= count || k.parent == k.id)
    contradiction(keyframe_name(k.id) + " has the impossible parent " + std::to_string(k.parent));
  if (k.culled) {
    if (k.parent == kNoKeyframe) contradiction(keyframe_name(k.id) + " is culled but has no parent");
    if (k.features || !k.points.empty() || !k.covisible.empty())
      contradiction(keyframe_name(k.id) + " is culled but has features");
    return;
  }
  if (k.parent != kNoKeyframe && keyframes[static_cast<size_t>(k.parent)].culled)
    contradiction(keyframe_name(k.id) + " hangs on culled keyframe " + std::to_string(k.parent));
  if (!k.features || k.features->descriptors.size() != k.features->size() || k.points.size() != k.features->size())
    contradiction(keyframe_name(k.id) + " has not as many points and descriptors as features");
  for (size_t i = 0; i < k.covisible.size(); ++i) {
    const Covisible& c = k.covisible[i];
    if (c.keyframe < 0 || c.keyframe >= count || c.keyframe == k.id || c.shared_points < 1)
      contradiction(keyframe_name(k.id) + " names an impossible covisible keyframe");
    if (i > 0) {
      const Covisible& before = k.covisible[i - 1];
      if (before.shared_points < c.shared_points ||
          (before.shared_points == c.shared_points && before.keyframe >= c.keyframe))
        contradiction("covisible keyframes of " + keyframe_name(k.id) + " are out of order");
    }
  }
}

// Follows next(0), next(next(0)) ...; throws when that comes back to where it was. `count` nodes; -1 ends a chain.
template <class Next>
void check_no_cycle(size_t count, const Next& next, const char* what) {
  enum : uint8_t { unseen, on_path, done };
  std::vector<uint8_t> state(count, unseen);
  std::vector<size_t> path;
  for (size_t start = 0; start < count; ++start) {
    path.clear();
    int64_t node = static_cast<int64_t>(start);
    while (node >= 0 && state[static_cast<size_t>(node)] == unseen) {
      state[static_cast<size_t>(node)] = on_path;
      path.push_back(static_cast<size_t>(node));
      node = next(static_cast<size_t>(node));
    }
    if (node >= 0 && state[static_cast<size_t>(node)] == on_path) contradiction(std::string(what) + " run in a circle");
    for (size_t p : path) state[p] = done;
  }
}

}  // namespace

Map Map::restore(std::vector<Keyframe> keyframes, std::vector<MapPoint> points, std::vector<RemovedPoint> removed) {
  Map map;
  const auto count = static_cast<KeyframeId>(keyframes.size());
  for (KeyframeId id = 0; id < count; ++id) check_parts(keyframes, id);

  const auto check_id = [count](PointId id, PointId before, bool first) {
    if (id == kNoPoint || birth_keyframe(id) >= count)
      contradiction(point_name(id) + " was born at a keyframe that is not there");
    if (!first && id <= before) contradiction(point_name(id) + " is out of order");
  };
  map.blocks_.reserve(keyframes.size());
  for (size_t i = 0; i < points.size(); ++i) {
    MapPoint& p = points[i];
    check_id(p.id, i > 0 ? points[i - 1].id : 0, i == 0);
    p.observations.clear();
    const PointId id = p.id;
    map.add_live(std::move(p));
    points[i].id = id;
  }
  map.point_count_ = points.size();
  for (size_t i = 0; i < removed.size(); ++i) {
    const RemovedPoint& r = removed[i];
    check_id(r.id, i > 0 ? removed[i - 1].id : 0, i == 0);
    if (map.slot(r.id)) contradiction(point_name(r.id) + " is both there and removed");
    map.add_gone(r);
  }

  map.keyframes_.reserve(keyframes.size());
  for (Keyframe& k : keyframes) {
    for (size_t f = 0; f < k.points.size(); ++f) {
      if (k.points[f] == kNoPoint) continue;
      if (map.point(k.points[f]) == nullptr)
        contradiction(keyframe_name(k.id) + " shows " + point_name(k.points[f]) + ", which is not there");
      auto& observations = map.edit_point(k.points[f]).observations;
      if (!observations.empty() && observations.back().keyframe == k.id)
        contradiction(keyframe_name(k.id) + " shows " + point_name(k.points[f]) + " twice");
      observations.push_back({k.id, static_cast<int32_t>(f)});
    }
    map.live_keyframe_count_ += !k.culled;
    if (!k.culled && !map.places_.full()) map.places_.add(k.id, k.features->descriptors);
    map.keyframes_.push_back({std::make_shared<Keyframe>(std::move(k)), map.epoch_.value()});
  }
  for (KeyframeId id = 0; id < count; ++id) map.enter_tree(id);
  PlaneId planes = 0;
  for (const auto& k : map.keyframes_)
    for (PlaneId p : k.value->plane_of_patch) planes = std::max(planes, p + 1);
  map.joined_to_.resize(static_cast<size_t>(planes));
  std::iota(map.joined_to_.begin(), map.joined_to_.end(), PlaneId{0});
  map.check_keyframes();
  map.check_forwarding();
  return map;
}

void Map::check_keyframes() const {
  check_no_cycle(
      keyframes_.size(), [this](size_t i) -> int64_t { return keyframes_[i].value->parent; }, "parents of keyframes");
  // Each edge of the covisibility graph is known to both ends. Edges are compared as sorted lists, since a keyframe may
  // have very many.
  struct Edge {
    KeyframeId a, b;
    int shared_points;
    auto operator<=>(const Edge&) const = default;
  };
  std::vector<Edge> forth, back;
  for (const auto& k : keyframes_)
    for (const Covisible& c : k.value->covisible) {
      forth.push_back({k.value->id, c.keyframe, c.shared_points});
      back.push_back({c.keyframe, k.value->id, c.shared_points});
    }
  std::sort(forth.begin(), forth.end());
  std::sort(back.begin(), back.end());
  if (forth != back) contradiction("two keyframes disagree on how many points they share");
  for (size_t i = 1; i < forth.size(); ++i)
    if (forth[i].a == forth[i - 1].a && forth[i].b == forth[i - 1].b)
      contradiction(keyframe_name(forth[i].a) + " names a covisible keyframe twice");
}

void Map::check_forwarding() const {
  const std::vector<RemovedPoint> removed = removed_points();
  const auto index_of = [&](PointId id) -> int64_t {
    const auto at = std::lower_bound(removed.begin(), removed.end(), id,
                                     [](const RemovedPoint& r, PointId wanted) { return r.id < wanted; });
    return at != removed.end() && at->id == id ? at - removed.begin() : -1;
  };
  for (const RemovedPoint& r : removed)
    if (r.replaced_by != kNoPoint && !slot(r.replaced_by))
      contradiction(point_name(r.id) + " was replaced by " + point_name(r.replaced_by) + ", which never was");
  check_no_cycle(
      removed.size(),
      [&](size_t i) -> int64_t { return removed[i].replaced_by == kNoPoint ? -1 : index_of(removed[i].replaced_by); },
      "replacements of points");
}

}  // namespace dkb
