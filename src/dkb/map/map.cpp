// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/map.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "dkb/util/radix_sort.h"

namespace dkb {
namespace {

bool shares_more(const Covisible& a, const Covisible& b) {
  return a.shared_points != b.shared_points ? a.shared_points > b.shared_points : a.keyframe < b.keyframe;
}

void enlist(std::vector<KeyframeId>& list, KeyframeId id) {
  const auto at = std::lower_bound(list.begin(), list.end(), id);
  if (at == list.end() || *at != id) list.insert(at, id);
}

void drop_covisible(std::vector<Covisible>& list, KeyframeId id) {
  std::erase_if(list, [id](const Covisible& c) { return c.keyframe == id; });
}

}  // namespace

MapView Map::snapshot() const {
  return std::make_shared<const Map>(*this);
}

const Keyframe* Map::keyframe(KeyframeId id) const {
  if (id < 0 || id >= keyframe_count()) return nullptr;
  return keyframes_[static_cast<size_t>(id)].value.get();
}

const Keyframe* Map::live_keyframe(KeyframeId id) const {
  const Keyframe* k = keyframe(id);
  return k != nullptr && !k->culled ? k : nullptr;
}

Map::Slot Map::slot(PointId id) const {
  if (id == kNoPoint) return {};
  const auto birth = static_cast<size_t>(birth_keyframe(id));
  if (birth >= blocks_.size() || !blocks_[birth].value) return {};
  const PointBlock& block = *blocks_[birth].value;
  const auto feature = static_cast<size_t>(birth_feature(id));
  const int place = feature < block.place_of_feature.size() ? block.place_of_feature[feature] : PointBlock::kNever;
  if (place == PointBlock::kNever) return {};
  if (place >= 0) return {&block.live[static_cast<size_t>(place)], nullptr};
  return {nullptr, &block.replaced_by[static_cast<size_t>(~place)]};
}

const MapPoint* Map::point(PointId id) const {
  return slot(id).live;
}

PointId Map::resolve(PointId id) const {
  for (Slot s = slot(id); s; s = slot(id)) {
    if (s.live != nullptr) return id;
    id = *s.replaced_by;
  }
  return kNoPoint;
}

Map::Ancestor Map::live_ancestor(KeyframeId id) const {
  const Keyframe* k = keyframe(id);
  if (k == nullptr) throw std::logic_error("map: no keyframe " + std::to_string(id));
  Ancestor found;
  while (k->culled) {
    found.cam_from_ancestor = found.cam_from_ancestor * k->cam_from_parent;
    k = keyframe(k->parent);
  }
  found.id = k->id;
  return found;
}

Rigid3 Map::cam_from_world(KeyframeId id) const {
  const Ancestor riding_on = live_ancestor(id);
  return riding_on.cam_from_ancestor * keyframe(riding_on.id)->cam_from_world;
}

KeyframeId Map::root(KeyframeId id) const {
  const Keyframe* k = keyframe(id);
  if (k == nullptr) throw std::logic_error("map: no keyframe " + std::to_string(id));
  if (roots_.size() == 1) return roots_.front();
  while (k->parent != kNoKeyframe) k = keyframe(k->parent);
  return k->id;
}

std::vector<KeyframeId> Map::root_of_each() const {
  std::vector<KeyframeId> roots(keyframes_.size(), kNoKeyframe);
  std::vector<KeyframeId> path;
  for (KeyframeId id = 0; id < keyframe_count(); ++id) {
    path.clear();
    KeyframeId at = id;
    for (; roots[static_cast<size_t>(at)] == kNoKeyframe && keyframe(at)->parent != kNoKeyframe;
         at = keyframe(at)->parent)
      path.push_back(at);
    if (roots[static_cast<size_t>(at)] == kNoKeyframe) roots[static_cast<size_t>(at)] = at;
    for (KeyframeId k : path) roots[static_cast<size_t>(k)] = roots[static_cast<size_t>(at)];
  }
  return roots;
}

std::vector<int> Map::map_of_each() const {
  std::vector<int> maps;
  maps.reserve(keyframes_.size());
  for (KeyframeId root : root_of_each()) maps.push_back(map_number(roots_, root));
  return maps;
}

std::vector<std::vector<KeyframeId>> Map::keyframes_by_map() const {
  const std::vector<int> map_of = map_of_each();
  std::vector<std::vector<KeyframeId>> by_map(std::max<size_t>(1, roots_.size()));
  for (KeyframeId id : live_keyframes()) by_map[static_cast<size_t>(map_of[static_cast<size_t>(id)])].push_back(id);
  return by_map;
}

std::vector<KeyframeId> Map::best_covisible(KeyframeId id, size_t most) const {
  const std::vector<Covisible>& all = keyframe(id)->covisible;
  std::vector<KeyframeId> best;
  for (size_t i = 0; i < std::min(all.size(), most); ++i) best.push_back(all[i].keyframe);
  return best;
}

std::vector<KeyframeId> Map::newest_beside(KeyframeId id, int most) const {
  std::vector<KeyframeId> newest;
  if (keyframe(id) == nullptr) return newest;
  const KeyframeId top = root(id);
  for (KeyframeId k = keyframe_count(); k-- > 0 && static_cast<int>(newest.size()) < most;)
    if (live_keyframe(k) != nullptr && root(k) == top) newest.push_back(k);
  std::reverse(newest.begin(), newest.end());
  return newest;
}

std::vector<KeyframeId> Map::live_keyframes() const {
  std::vector<KeyframeId> ids;
  for (const auto& k : keyframes_)
    if (!k.value->culled) ids.push_back(k.value->id);
  return ids;
}

std::vector<PointId> Map::live_points() const {
  std::vector<PointId> ids;
  ids.reserve(point_count_);
  for (const auto& block : blocks_) {
    if (!block.value) continue;
    for (const int place : block.value->place_of_feature)
      if (place >= 0) ids.push_back(block.value->live[static_cast<size_t>(place)].id);
  }
  return ids;
}

std::vector<Covisible> Map::observers_of(const std::vector<PointId>& points) const {
  std::vector<int> shared(keyframes_.size(), 0);
  std::vector<Covisible> observers;
  for (PointId id : points)
    if (const MapPoint* p = point(id))
      for (const Observation& o : p->observations)
        if (shared[static_cast<size_t>(o.keyframe)]++ == 0) observers.push_back({o.keyframe, 0});
  for (Covisible& o : observers) o.shared_points = shared[static_cast<size_t>(o.keyframe)];
  std::sort(observers.begin(), observers.end(), shares_more);
  return observers;
}

std::vector<PointId> Map::points_of(const std::vector<KeyframeId>& keyframes) const {
  std::vector<PointId> ids;
  for (KeyframeId k : keyframes)
    for (PointId p : keyframe(k)->points)
      if (p != kNoPoint) ids.push_back(p);
  radix_sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

std::vector<RemovedPoint> Map::removed_points() const {
  std::vector<RemovedPoint> removed;
  for (size_t birth = 0; birth < blocks_.size(); ++birth) {
    if (!blocks_[birth].value) continue;
    const PointBlock& block = *blocks_[birth].value;
    for (size_t feature = 0; feature < block.place_of_feature.size(); ++feature) {
      const int place = block.place_of_feature[feature];
      if (place < 0 && place != PointBlock::kNever)
        removed.push_back({make_point_id(static_cast<KeyframeId>(birth), static_cast<int>(feature)),
                           block.replaced_by[static_cast<size_t>(~place)]});
    }
  }
  return removed;
}

Keyframe& Map::edit(KeyframeId id) {
  Shared<Keyframe>& shared = keyframes_.at(static_cast<size_t>(id));
  if (shared.epoch != epoch_.value()) {
    shared.value = std::make_shared<Keyframe>(*shared.value);
    shared.epoch = epoch_.value();
  }
  return *shared.value;
}

Map::PointBlock& Map::edit_block(KeyframeId birth) {
  const auto index = static_cast<size_t>(birth);
  if (blocks_.size() <= index) blocks_.resize(index + 1);
  Shared<PointBlock>& shared = blocks_[index];
  if (shared.epoch != epoch_.value()) {
    shared.value = shared.value ? std::make_shared<PointBlock>(*shared.value) : std::make_shared<PointBlock>();
    shared.epoch = epoch_.value();
  }
  return *shared.value;
}

MapPoint& Map::edit_point(PointId id) {
  if (point(id) == nullptr) throw std::logic_error("map: no point " + std::to_string(id));
  PointBlock& block = edit_block(birth_keyframe(id));
  return block.live[static_cast<size_t>(block.place_of_feature[static_cast<size_t>(birth_feature(id))])];
}

void Map::add_keyframe(Keyframe keyframe) {
  if (keyframe.id != keyframe_count()) throw std::logic_error("map: keyframe ids must follow one another");
  const KeyframeId id = keyframe.id;
  const std::vector<PointId> points = std::move(keyframe.points);
  keyframe.points.assign(keyframe.features->size(), kNoPoint);
  // Beyond that the place of a keyframe is found by those around it.
  if (!places_.full()) places_.add(id, keyframe.features->descriptors);
  keyframes_.push_back({std::make_shared<Keyframe>(std::move(keyframe)), epoch_.value()});
  enter_tree(id);
  ++live_keyframe_count_;
  for (size_t i = 0; i < points.size(); ++i) {
    const PointId p = resolve(points[i]);
    if (p != kNoPoint) observe(p, id, static_cast<int>(i));
  }
}

// What the keyframe says of others is told to them.
void Map::enter_tree(KeyframeId id) {
  Keyframe& k = edit(id);
  k.children.clear();
  k.followers.clear();
  if (k.parent == kNoKeyframe) enlist(roots_, id);
  if (!k.culled && keyframe(k.parent) != nullptr) enlist(edit(k.parent).children, id);
  if (k.motion && keyframe(k.motion->previous) != nullptr) enlist(edit(k.motion->previous).followers, id);
}

void Map::hang(KeyframeId id, KeyframeId parent) {
  const KeyframeId before = std::exchange(edit(id).parent, parent);
  std::erase(before == kNoKeyframe ? roots_ : edit(before).children, id);
  enlist(parent == kNoKeyframe ? roots_ : edit(parent).children, id);
}

void Map::tell_motion(KeyframeId id, std::shared_ptr<const KeyframeMotion> motion) {
  const auto before = std::exchange(edit(id).motion, motion);
  if (before && keyframe(before->previous) != nullptr) std::erase(edit(before->previous).followers, id);
  if (motion) enlist(edit(motion->previous).followers, id);
}

void Map::add_point(MapPoint point) {
  const PointId id = point.id;
  if (id == kNoPoint) throw std::logic_error("map: a point without an id");
  if (slot(id)) throw std::logic_error("map: point " + std::to_string(id) + " was born before");
  add_live(std::move(point));
  ++point_count_;
}

int16_t& Map::place_of(PointId id) {
  PointBlock& block = edit_block(birth_keyframe(id));
  const auto feature = static_cast<size_t>(birth_feature(id));
  if (block.place_of_feature.size() <= feature) block.place_of_feature.resize(feature + 1, PointBlock::kNever);
  return block.place_of_feature[feature];
}

void Map::add_live(MapPoint point) {
  PointBlock& block = edit_block(birth_keyframe(point.id));
  place_of(point.id) = static_cast<int16_t>(block.live.size());
  block.live.push_back(std::move(point));
}

void Map::add_gone(RemovedPoint point) {
  PointBlock& block = edit_block(birth_keyframe(point.id));
  place_of(point.id) = static_cast<int16_t>(~block.replaced_by.size());
  block.replaced_by.push_back(point.replaced_by);
}

void Map::observe(PointId point_id, KeyframeId keyframe_id, int feature) {
  Keyframe& k = edit(keyframe_id);
  PointId& entry = k.points.at(static_cast<size_t>(feature));
  if (entry == point_id) return;
  const MapPoint* seen = point(point_id);
  if (seen == nullptr) return;
  for (const Observation& o : seen->observations)
    if (o.keyframe == keyframe_id) return;  // one feature per point and keyframe: the first stays
  if (entry != kNoPoint) forget(entry, keyframe_id);
  entry = point_id;
  auto& list = edit_point(point_id).observations;
  const Observation o{keyframe_id, feature};
  list.insert(std::upper_bound(list.begin(), list.end(), o,
                               [](const Observation& a, const Observation& b) { return a.keyframe < b.keyframe; }),
              o);
}

void Map::forget(PointId point_id, KeyframeId keyframe_id) {
  if (point(point_id) == nullptr) return;
  MapPoint& p = edit_point(point_id);
  const auto it = std::find_if(p.observations.begin(), p.observations.end(),
                               [&](const Observation& o) { return o.keyframe == keyframe_id; });
  if (it == p.observations.end()) return;
  edit(keyframe_id).points[static_cast<size_t>(it->feature)] = kNoPoint;
  p.observations.erase(it);
  if (p.observations.empty()) remove_point(point_id);
}

void Map::remove_point(PointId id, PointId replaced_by) {
  if (point(id) == nullptr) return;
  for (const Observation& o : point(id)->observations)
    edit(o.keyframe).points[static_cast<size_t>(o.feature)] = kNoPoint;
  // The last of the block takes its place.
  std::vector<MapPoint>& live = edit_block(birth_keyframe(id)).live;
  const auto place = static_cast<size_t>(place_of(id));
  if (place + 1 < live.size()) {
    live[place] = std::move(live.back());
    place_of(live[place].id) = static_cast<int16_t>(place);
  }
  live.pop_back();
  add_gone({id, replaced_by});
  --point_count_;
}

void Map::fuse(PointId from, PointId into) {
  if (from == into || point(from) == nullptr || point(into) == nullptr) return;
  const std::vector<Observation> moved = point(from)->observations;
  const int found = point(from)->found, visible = point(from)->visible;
  remove_point(from, into);
  for (const Observation& o : moved) observe(into, o.keyframe, o.feature);
  MapPoint& survivor = edit_point(into);
  survivor.found += found;
  survivor.visible += visible;
}

void Map::update_covisibility(KeyframeId id, int min_shared_points) {
  const Keyframe* self = live_keyframe(id);
  if (self == nullptr) return;
  std::vector<Covisible> found = observers_of(self->points);
  drop_covisible(found, id);
  // The best one stays, however little they share, and whoever has nobody else.
  const auto has_others = [&](const Covisible& c) {
    const std::vector<Covisible>& its = keyframe(c.keyframe)->covisible;
    return std::any_of(its.begin(), its.end(), [id](const Covisible& other) { return other.keyframe != id; });
  };
  for (size_t i = found.size(); i-- > 1 && found[i].shared_points < min_shared_points;)
    if (has_others(found[i])) found.erase(found.begin() + static_cast<std::ptrdiff_t>(i));
  const std::vector<Covisible> before = std::exchange(edit(id).covisible, found);
  for (const Covisible& c : before)
    if (points_shared_with(c.keyframe, found) == 0) drop_covisible(edit(c.keyframe).covisible, id);
  for (const Covisible& c : found) {
    if (points_shared_with(id, keyframe(c.keyframe)->covisible) == c.shared_points) continue;
    auto& list = edit(c.keyframe).covisible;
    drop_covisible(list, id);
    const Covisible mine{id, c.shared_points};
    list.insert(std::upper_bound(list.begin(), list.end(), mine, shares_more), mine);
  }
}

void Map::date_back() {
  FrameIndex newest = -1;
  for (const auto& k : keyframes_) newest = std::max(newest, k.value->frame);
  for (KeyframeId id = 0; id < keyframe_count(); ++id) edit(id).frame -= newest + 1;
}

void Map::set_parent(KeyframeId id, KeyframeId parent) {
  if (parent != kNoKeyframe) parent = live_ancestor(parent).id;
  for (const Keyframe* k = keyframe(parent); k != nullptr; k = keyframe(k->parent))
    if (k->id == id)
      throw std::logic_error("map: keyframe " + std::to_string(id) + " cannot hang on its own descendant");
  hang(id, parent);
}

// What told of the way to this keyframe and from it tells of the way past it: of the first that follows, since what is
// known of the way to it must not count twice. Others, and where nothing tells of the way to it, begin at its parent,
// on which it rides: as when a keyframe comes whose motion began at a culled one.
void Map::hand_on_motion(KeyframeId id, KeyframeId parent, const Rigid3& cam_from_parent) {
  std::shared_ptr<const KeyframeMotion> before = keyframe(id)->motion;
  const MotionPrior since_parent = ride_on(cam_from_parent, points_shared_with(parent, keyframe(id)->covisible));
  const std::vector<KeyframeId> followers = keyframe(id)->followers;
  tell_motion(id, nullptr);
  for (KeyframeId next : followers) {
    const MotionPrior& since = keyframe(next)->motion->since;
    const KeyframeMotion past = before ? KeyframeMotion{before->previous, joined(before->since, since)}
                                       : KeyframeMotion{parent, joined(since_parent, since)};
    before.reset();
    // Where two maps were joined a parent may be the younger one.
    tell_motion(next, past.previous < next ? std::make_shared<const KeyframeMotion>(past) : nullptr);
  }
}

PlaneId Map::plane(PlaneId id) const {
  while (joined_to_[static_cast<size_t>(id)] != id) id = joined_to_[static_cast<size_t>(id)];
  return id;
}

PlaneId Map::add_plane() {
  joined_to_.push_back(static_cast<PlaneId>(joined_to_.size()));
  return joined_to_.back();
}

void Map::join_planes(PlaneId a, PlaneId b) {
  const PlaneId one = plane(a), other = plane(b);
  joined_to_[static_cast<size_t>(std::max(one, other))] = std::min(one, other);
}

void Map::name_planes(KeyframeId id, std::vector<PlaneId> plane_of_patch) {
  edit(id).plane_of_patch = std::move(plane_of_patch);
}

void Map::cull_keyframe(KeyframeId id) {
  const Keyframe* k = live_keyframe(id);
  if (k == nullptr || k->parent == kNoKeyframe) return;  // the root stays
  const KeyframeId parent = k->parent;
  const Rigid3 cam_from_parent = k->cam_from_world * cam_from_world(parent).inverse();
  const std::vector<PointId> points = k->points;
  for (PointId p : points)
    if (p != kNoPoint) forget(p, id);
  for (const Covisible& c : keyframe(id)->covisible) drop_covisible(edit(c.keyframe).covisible, id);
  for (KeyframeId child : std::vector<KeyframeId>(keyframe(id)->children)) hang(child, parent);
  hand_on_motion(id, parent, cam_from_parent);
  std::erase(edit(parent).children, id);
  Keyframe& me = edit(id);
  me.culled = true;
  me.cam_from_parent = cam_from_parent;
  me.features.reset();
  me.points = std::vector<PointId>();  // {} would keep the memory
  me.covisible = std::vector<Covisible>();
  me.planes.reset();
  me.plane_of_patch = std::vector<PlaneId>();
  me.children = me.followers = std::vector<KeyframeId>();
  --live_keyframe_count_;
  places_.remove(id);
}

}  // namespace dkb
