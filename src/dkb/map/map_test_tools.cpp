// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/map_test_tools.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <set>

#include "dkb/map/byte_stream.h"

namespace dkb::test {
namespace {

// A point that is there, or was; kNoPoint in an empty map.
PointId any_point(const Map& map, Random& random) {
  const auto live = map.live_points();
  auto removed = map.removed_points();
  std::erase_if(removed, [&](const RemovedPoint& r) { return map.resolve(r.id) == kNoPoint; });
  if (random.below(8) == 0 && !removed.empty()) return removed[random.below(static_cast<uint32_t>(removed.size()))].id;
  if (live.empty()) return kNoPoint;
  return live[random.below(static_cast<uint32_t>(live.size()))];
}

KeyframeId any_live_keyframe(const Map& map, Random& random) {
  const auto live = map.live_keyframes();
  return live[random.below(static_cast<uint32_t>(live.size()))];
}

Rigid3 random_pose(Random& random) {
  return {rotation_from_vector({random.normal(), random.normal(), random.normal()}),
          {random.normal(), random.normal(), random.normal()}};
}

void write(ByteWriter& out, float v) {
  out.u32(std::bit_cast<uint32_t>(v));
}
void write(ByteWriter& out, const Rigid3& pose) {
  for (int i = 0; i < 4; ++i) out.f64(pose.rotation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) out.f64(pose.translation[i]);
}
void write(ByteWriter& out, Rgb c) {
  out.u8(c.r);
  out.u8(c.g);
  out.u8(c.b);
}
void write(ByteWriter& out, const Descriptor& d) {
  for (uint64_t word : d) out.u64(word);
}

void write(ByteWriter& out, const RgbdFeatures& features) {
  for (size_t i = 0; i < features.size(); ++i) {
    const Keypoint& k = features.keypoints[i];
    for (float v : {k.pixel.x(), k.pixel.y(), k.image_pixel.x(), k.image_pixel.y(), k.depth, k.angle, k.response,
                    k.lent_depth, k.place_sigma})
      write(out, v);
    out.u8(k.octave);
    write(out, k.colour);
    write(out, features.descriptors[i]);
    features.grid.for_each_near({k.pixel.x(), k.pixel.y(), 8}, [&](int near) { out.i32(near); });
  }
}

std::string observations_broken(const Map& map) {
  for (PointId id : map.live_points()) {
    const MapPoint* p = map.point(id);
    if (p == nullptr || p->id != id || map.resolve(id) != id) return "a live point is not found under its id";
    for (size_t i = 0; i < p->observations.size(); ++i) {
      const Observation& o = p->observations[i];
      if (i > 0 && p->observations[i - 1].keyframe >= o.keyframe) return "observations are out of order";
      const Keyframe* k = map.live_keyframe(o.keyframe);
      if (k == nullptr) return "a point is seen by a keyframe that is not live";
      if (k->points.at(static_cast<size_t>(o.feature)) != id) return "a keyframe does not know of an observation";
    }
  }
  for (KeyframeId id : map.live_keyframes()) {
    const Keyframe& k = *map.keyframe(id);
    if (k.points.size() != k.features->size()) return "a keyframe has not a point entry per feature";
    for (size_t f = 0; f < k.points.size(); ++f) {
      if (k.points[f] == kNoPoint) continue;
      const MapPoint* p = map.point(k.points[f]);
      if (p == nullptr) return "a keyframe shows a point that is not there";
      if (std::count(p->observations.begin(), p->observations.end(), Observation{id, static_cast<int32_t>(f)}) != 1)
        return "a point does not know of an observation";
    }
  }
  return "";
}

std::string covisibility_broken(const Map& map) {
  for (KeyframeId id : map.live_keyframes()) {
    const auto& list = map.keyframe(id)->covisible;
    for (size_t i = 0; i < list.size(); ++i) {
      if (i > 0 && (list[i - 1].shared_points < list[i].shared_points ||
                    (list[i - 1].shared_points == list[i].shared_points && list[i - 1].keyframe >= list[i].keyframe)))
        return "covisible keyframes are out of order";
      const Keyframe* other = map.live_keyframe(list[i].keyframe);
      if (other == nullptr || other->id == id) return "a covisible keyframe is not live";
      if (std::count_if(other->covisible.begin(), other->covisible.end(), [&](const Covisible& c) {
            return c.keyframe == id && c.shared_points == list[i].shared_points;
          }) != 1)
        return "covisibility is not symmetric";
    }
  }
  return "";
}

std::string tree_broken(const Map& map) {
  int live = 0;
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    const Keyframe& k = *map.keyframe(id);
    live += !k.culled;
    int steps = 0;
    for (KeyframeId a = id; a != kNoKeyframe; a = map.keyframe(a)->parent)
      if (++steps > map.keyframe_count()) return "parents run in a circle";
    if (k.culled && (k.parent == kNoKeyframe || k.features || !k.points.empty() || !k.covisible.empty()))
      return "a culled keyframe is not empty, or has no parent";
    if (!k.culled && k.parent != kNoKeyframe && map.live_keyframe(k.parent) == nullptr)
      return "a live keyframe hangs on a culled one";
  }
  const std::vector<KeyframeId> roots = map.root_of_each();
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id)
    if (roots[static_cast<size_t>(id)] != map.root(id)) return "roots are told in two ways";
  std::vector<KeyframeId> tops;
  std::vector<std::vector<KeyframeId>> children(roots.size()), followers(roots.size());
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    const Keyframe& k = *map.keyframe(id);
    if (k.parent == kNoKeyframe)
      tops.push_back(id);
    else if (!k.culled)
      children[static_cast<size_t>(k.parent)].push_back(id);
    if (k.motion) followers[static_cast<size_t>(k.motion->previous)].push_back(id);
  }
  if (tops != map.roots()) return "a root is not listed";
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id)
    if (map.keyframe(id)->children != children[static_cast<size_t>(id)] ||
        map.keyframe(id)->followers != followers[static_cast<size_t>(id)])
      return "who hangs on a keyframe is told in two ways";
  if (live != map.live_keyframe_count() || static_cast<size_t>(live) != map.live_keyframes().size())
    return "live keyframes are counted wrongly";
  return "";
}

std::string removed_broken(const Map& map) {
  if (map.live_points().size() != map.point_count()) return "points are counted wrongly";
  std::set<PointId> ids;
  for (PointId id : map.live_points())
    if (!ids.insert(id).second) return "a point is listed twice";
  PointId before = 0;
  for (const RemovedPoint& r : map.removed_points()) {
    if (!ids.insert(r.id).second) return "a removed point is listed twice";
    if (r.id < before) return "removed points are out of order";
    before = r.id;
    if (map.point(r.id) != nullptr) return "a removed point is still there";
    const PointId survivor = map.resolve(r.id);
    if (survivor != kNoPoint && map.point(survivor) == nullptr) return "a point resolves to one that is gone";
  }
  return "";
}

}  // namespace

namespace {

Matrix6d random_covariance(Random& random) {
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root.data()[i] = 0.01 * random.normal();
  const Matrix6d product = root * root.transpose();
  return 0.5 * (product + product.transpose());  // symmetric to the last bit
}

std::shared_ptr<const PlaneView> random_planes(Random& random) {
  auto view = std::make_shared<PlaneView>();
  const CameraModel camera = distorted_camera();
  view->patch_at = Image<uint8_t>(camera.width / PlaneView::kBlock, camera.height / PlaneView::kBlock);
  for (uint32_t p = random.below(4); p > 0; --p) {
    PlanePatch& patch = view->patches.emplace_back();
    patch.over_distance = {random.normal(), random.normal(), 1};
    patch.covariance = random_covariance(random).topLeftCorner<3, 3>();
    patch.centre = {random.normal(), random.normal(), 2};
    for (int i = 0; i < 50; ++i)
      view->patch_at.data()[random.below(static_cast<uint32_t>(view->patch_at.size()))] =
          static_cast<uint8_t>(view->patches.size());
  }
  return view;
}

}  // namespace

CameraModel distorted_camera() {
  return *builtin_camera("fr1");
}

std::shared_ptr<const RgbdFeatures> random_features(Random& random, int count, const CameraModel& camera, bool follow) {
  const UndistortionTable undistort(camera);
  auto features = std::make_shared<RgbdFeatures>();
  for (int i = 0; i < count; ++i) {
    Keypoint k;
    k.image_pixel = {static_cast<float>(random.uniform(16, camera.width - 16)),
                     static_cast<float>(random.uniform(16, camera.height - 16))};
    k.pixel = undistort(k.image_pixel.x(), k.image_pixel.y());
    if (!follow) k.pixel += Eigen::Vector2f{static_cast<float>(random.normal()), static_cast<float>(random.normal())};
    k.depth = random.below(5) == 0 ? 0.0f : static_cast<float>(random.below(20000)) / 5000.0f;
    k.angle = static_cast<float>(random.uniform(0, 6.28));
    k.response = std::floor(static_cast<float>(random.uniform(20, 80)));
    k.octave = static_cast<uint8_t>(i * 8 / count);  // extraction goes level by level
    k.place_sigma = 0.1f * k.angle;
    if (k.depth == 0) k.lent_depth = k.response / 50.0f;
    const auto grey = static_cast<uint8_t>(random.below(240));
    k.colour = {static_cast<uint8_t>(grey + random.below(16)), grey, static_cast<uint8_t>(grey + random.below(16))};
    features->keypoints.push_back(k);
    features->descriptors.push_back({random.next(), random.next(), random.next(), random.next()});
  }
  if (count > 0) features->grid = KeypointGrid(features->keypoints, camera.width, camera.height);
  return features;
}

KeyframeId add_random_keyframe(Map& map, Random& random, int features, int seen, int born) {
  Keyframe k;
  k.id = map.keyframe_count();
  k.frame = 7 * k.id + 3;
  k.timestamp = 1305031102.175 + 0.2 * k.id;
  k.features = random_features(random, features, distorted_camera(), random.below(4) != 0);
  k.cam_from_world = random_pose(random);
  k.points.assign(k.features->size(), kNoPoint);
  if (k.id > 0) {
    if (random.below(8) != 0) k.parent = any_live_keyframe(map, random);  // else it starts a map that is not joined
    // Points of the newest keyframes, each at one feature; what was fused or removed by now comes along too.
    std::vector<PointId> near;
    for (KeyframeId n = std::max(0, k.id - 4); n < k.id; ++n)
      for (PointId p : map.keyframe(n)->points)
        if (p != kNoPoint) near.push_back(p);
    for (int i = 0; i < seen && !near.empty(); ++i)
      k.points[random.below(static_cast<uint32_t>(features))] = near[random.below(static_cast<uint32_t>(near.size()))];
  }
  const KeyframeId id = k.id;
  if (k.id > 0 && random.below(4) != 0)
    k.motion = std::make_shared<const KeyframeMotion>(
        KeyframeMotion{map.live_keyframes().back(), {random_pose(random), false, random_covariance(random)}});
  if (random.below(3) != 0) k.planes = random_planes(random);
  const size_t patches = k.planes ? k.planes->patches.size() : 0;
  map.add_keyframe(std::move(k));
  std::vector<PlaneId> planes;
  for (size_t p = 0; p < patches; ++p) {
    planes.push_back(map.add_plane());
    for (PlaneId before : map.keyframe(std::max(0, id - 1))->plane_of_patch)
      if (random.below(3) == 0) map.join_planes(planes.back(), before);
  }
  if (patches > 0) map.name_planes(id, planes);
  for (int i = 0; i < born; ++i) {
    const auto feature = static_cast<int>(random.below(static_cast<uint32_t>(features)));
    if (map.keyframe(id)->points[static_cast<size_t>(feature)] != kNoPoint) continue;
    const PointId point = make_point_id(id, feature);
    if (map.point(point) != nullptr) continue;
    MapPoint p;
    p.id = point;
    p.position = {random.normal(), random.normal(), random.normal()};
    p.normal =
        Eigen::Vector3f{static_cast<float>(random.normal()), static_cast<float>(random.normal()), 1.0f}.normalized();
    p.reference_distance = static_cast<float>(random.uniform(0.5, 5));
    p.reference_scale = 1.2f;
    const auto f = static_cast<size_t>(feature);
    p.descriptor = map.keyframe(id)->features->descriptors[f];
    if (random.below(50) == 0) p.descriptor[1] ^= 1;  // a descriptor that no keyframe has
    p.colour = map.keyframe(id)->features->keypoints[f].colour;
    p.found = static_cast<int>(random.below(300));
    p.visible = p.found + static_cast<int>(random.below(20));
    map.add_point(std::move(p));
    map.observe(point, id, feature);
  }
  map.update_covisibility(id, 3);
  return id;
}

void random_edit(Map& map, Random& random) {
  const KeyframeId k = any_live_keyframe(map, random);
  const PointId p = any_point(map, random);
  switch (random.below(9)) {
    case 0:
      map.observe(p, k, static_cast<int>(random.below(static_cast<uint32_t>(map.keyframe(k)->points.size()))));
      break;
    case 1:
      map.forget(p, k);
      break;
    case 2:
      map.remove_point(p);
      break;
    case 3:
      map.fuse(p, any_point(map, random));
      break;
    case 4:
      map.set_pose(k, random_pose(random));
      break;
    case 5:
      if (map.point(p) != nullptr) map.edit_point(p).position.x() += 1;
      break;
    case 6:
      map.update_covisibility(k, 1 + static_cast<int>(random.below(5)));
      break;
    case 7:
      if (random.below(6) == 0) map.cull_keyframe(k);
      break;
    default:
      if (k > 0 && map.keyframe(k)->parent != kNoKeyframe) map.set_parent(k, map.keyframe(map.keyframe(k)->parent)->id);
  }
}

Map random_map(uint64_t seed, int keyframes, int features, int edits_per_keyframe) {
  Random random(seed);
  Map map;
  for (int k = 0; k < keyframes; ++k) {
    add_random_keyframe(map, random, features, features / 2, features / 5 + 1);
    for (int e = 0; e < edits_per_keyframe; ++e) random_edit(map, random);
  }
  return map;
}

Keyframe keyframe_at(KeyframeId id, double x, int features) {
  Random random(static_cast<uint64_t>(id) + 1);
  Keyframe k;
  k.id = id;
  k.features = random_features(random, features, CameraModel(), true);
  k.cam_from_world.translation.x() = x;
  k.parent = id - 1;  // kNoKeyframe for the first
  return k;
}

PointId born(Map& map, KeyframeId keyframe, int feature) {
  MapPoint p;
  p.id = make_point_id(keyframe, feature);
  map.add_point(p);
  map.observe(p.id, keyframe, feature);
  return p.id;
}

ThreeKeyframes::ThreeKeyframes() {
  for (KeyframeId id = 0; id < 3; ++id) map.add_keyframe(keyframe_at(id, id));
  a = born(map, 0, 0), b = born(map, 0, 1), c = born(map, 0, 2), d = born(map, 0, 3);
  map.observe(a, 1, 5);
  map.observe(b, 1, 4);
  map.observe(c, 1, 3);
  map.observe(a, 2, 0);
}

std::string broken_invariant(const Map& map) {
  for (const auto& check : {observations_broken, covisibility_broken, tree_broken, removed_broken})
    if (const std::string broken = check(map); !broken.empty()) return broken;
  return "";
}

std::string fingerprint(const Map& map) {
  ByteWriter out;
  std::map<PlaneId, int32_t> planes;  // numbered as they come: a file numbers them anew
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    const Keyframe& k = *map.keyframe(id);
    out.i32(k.id);
    out.i32(k.frame);
    out.f64(k.timestamp);
    write(out, k.cam_from_world);
    write(out, k.cam_from_parent);
    write(out, map.cam_from_world(id));
    out.i32(k.parent);
    out.u8(k.culled);
    if (k.features) write(out, *k.features);
    for (PointId p : k.points) out.u32(p);
    for (const Covisible& c : k.covisible) {
      out.i32(c.keyframe);
      out.i32(c.shared_points);
    }
    if (k.motion) {
      out.i32(k.motion->previous);
      write(out, k.motion->since.previous_from_current);
      for (double v : k.motion->since.covariance.reshaped()) out.f64(v);
    }
    for (PlaneId p : k.plane_of_patch)
      out.i32(planes.emplace(map.plane(p), static_cast<int32_t>(planes.size())).first->second);
    if (!k.planes) continue;
    for (const PlanePatch& patch : k.planes->patches) {
      for (int i = 0; i < 3; ++i) out.f64(patch.over_distance[i]), out.f64(patch.centre[i]);
      for (double v : patch.covariance.reshaped()) out.f64(v);
    }
    for (size_t i = 0; i < k.planes->patch_at.size(); ++i) out.u8(k.planes->patch_at.data()[i]);
  }
  for (PointId id : map.live_points()) {
    const MapPoint& p = *map.point(id);
    out.u32(p.id);
    for (int i = 0; i < 3; ++i) out.f64(p.position[i]);
    for (int i = 0; i < 3; ++i) write(out, p.normal[i]);
    write(out, p.reference_distance);
    write(out, p.reference_scale);
    write(out, p.descriptor);
    write(out, p.colour);
    out.i32(p.found);
    out.i32(p.visible);
    for (const Observation& o : p.observations) {
      out.i32(o.keyframe);
      out.i32(o.feature);
    }
  }
  for (const RemovedPoint& r : map.removed_points()) {
    if (map.resolve(r.id) == kNoPoint) continue;
    out.u32(r.id);
    out.u32(map.resolve(r.id));
  }
  return out.bytes();
}

}  // namespace dkb::test
