// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/local_mapper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "dkb/matching/candidates.h"
#include "dkb/util/chi_square.h"

namespace dkb {
namespace {

constexpr int kMinSharedPoints = 15;     // that make two keyframes covisible
constexpr double kMinFoundRatio = 0.25;  // found / visible below which a young point is dropped
constexpr int kProbationKeyframes = 3;   // after its birth that a point is on probation
constexpr int kMinObservers = 2;         // keyframes that must see a point by the end of its probation
constexpr int kRedundantObservers = 3;   // others at the same scale or finer that make a keyframe's point redundant
constexpr size_t kFusionKeyframes = 10;  // covisible keyframes whose points are fused with a new keyframe's
constexpr double kFusionRadius = 3.0;    // [px] at the finest level
constexpr double kSeamTolerance = 2.0;   // factor on radius and error limit of fusion where a loop was just closed
constexpr size_t kCompared = 48;         // descriptors of a point that are compared, each with each

// The first of the descriptors, at most kCompared, whose upper median distance to all of them is least.
size_t central_descriptor(std::span<const Descriptor> descriptors) {
  const size_t n = descriptors.size();
  if (n <= 2) return 0;
  std::array<std::array<int, kCompared>, kCompared> distances;
  for (size_t i = 0; i < n; ++i) {
    distances[i][i] = 0;
    for (size_t j = 0; j < i; ++j) distances[i][j] = distances[j][i] = hamming_distance(descriptors[i], descriptors[j]);
  }
  size_t chosen = 0;
  int least = std::numeric_limits<int>::max();
  for (size_t i = 0; i < n; ++i) {
    const std::span<int> of_i(distances[i].data(), n);
    // The median is below the least so far if so many are, which takes no sorting.
    const auto below = std::count_if(of_i.begin(), of_i.end(), [least](int d) { return d < least; });
    if (static_cast<size_t>(below) <= n / 2) continue;
    std::nth_element(of_i.begin(), of_i.begin() + static_cast<std::ptrdiff_t>(n / 2), of_i.end());
    least = of_i[n / 2];
    chosen = i;
  }
  return chosen;
}

}  // namespace

LocalMapper::LocalMapper(const Optics& optics, const MappingOptions& options, Map map)
    : optics_(optics), options_(options), planes_(optics.camera, optics.noise), map_(std::move(map)) {
  for (PointId id : map_.live_points())
    if (map_.keyframe_count() - 1 - birth_keyframe(id) < kProbationKeyframes) young_.push_back(id);
}

MapView LocalMapper::process(const KeyframePacket& packet) {
  const Stopwatch whole;
  apply_reports(packet);
  if (packet.id == kNoKeyframe) return map_.snapshot();
  insert(packet);
  cull_if_empty(packet.id - 1);
  cull_points(packet.id);
  const auto triangulated = triangulate_new_points(map_, packet.id, optics_);
  young_.insert(young_.end(), triangulated.begin(), triangulated.end());
  report_.points_created += static_cast<int>(triangulated.size());
  refresh(triangulated);
  fuse_neighbours(packet.id);
  map_.update_covisibility(packet.id, kMinSharedPoints);
  if (packet.planes) planes_.recognise(map_, packet.id);
  if (map_.live_keyframe_count() > 1) {
    const Stopwatch ba;
    const std::vector<PointId> moved = local_bundle_adjustment(map_, packet.id, optics_, options_.ba);
    times_.add("local_ba", ba.ms());
    refresh(moved);  // those that were fused are among them
    cull_keyframes(packet.id);
  }
  times_.add("mapping", whole.ms());
  return map_.snapshot();
}

MapView LocalMapper::apply(const MapCorrection& correction) {
  const Stopwatch whole;
  move_map(map_, correction);
  for (const auto& [a, b] : correction.same) {
    const PointId one = map_.resolve(a), other = map_.resolve(b);
    if (one == kNoPoint || other == kNoPoint || one == other) continue;
    fuse_pair(one, other);
    ++report_.points_fused;
  }
  std::vector<KeyframeId> near = correction.near_side, far = correction.far_side;
  for (auto* side : {&near, &far})
    std::erase_if(*side, [this](KeyframeId k) { return map_.live_keyframe(k) == nullptr; });
  for (KeyframeId k : near) report_.points_fused += fuse_into(k, map_.points_of(far), kSeamTolerance);
  for (KeyframeId k : far) report_.points_fused += fuse_into(k, map_.points_of(near), kSeamTolerance);
  near.insert(near.end(), far.begin(), far.end());
  const std::vector<PointId> seam = map_.points_of(near);
  refresh(seam);
  // Whoever sees a point of one side may share it with whoever sees it from the other.
  for (const Covisible& c : map_.observers_of(seam)) map_.update_covisibility(c.keyframe, kMinSharedPoints);
  times_.add("map_correction", whole.ms());
  return map_.snapshot();
}

void LocalMapper::apply_reports(const KeyframePacket& packet) {
  for (PointId id : packet.retracted) {
    if (map_.point(id) == nullptr) continue;  // gone, or fused into one that others saw as well
    map_.remove_point(id);
    ++report_.points_retracted;
  }
  for (const PointVisibility& s : packet.visibility) {
    const PointId id = map_.resolve(s.point);
    if (id == kNoPoint) continue;
    MapPoint& p = map_.edit_point(id);
    p.visible += s.visible;
    p.found += s.found;
  }
}

void LocalMapper::insert(const KeyframePacket& packet) {
  Keyframe k;
  k.id = packet.id;
  k.frame = packet.frame;
  k.timestamp = packet.timestamp;
  k.features = packet.features;
  k.cam_from_world = packet.reference == kNoKeyframe
                         ? packet.cam_from_reference
                         : packet.cam_from_reference * map_.cam_from_world(packet.reference);
  // A motion ties nothing together where the map begins, or between maps whose worlds are not joined. That from a
  // keyframe culled since is that from what this rides on.
  if (packet.motion && packet.reference != kNoKeyframe && map_.keyframe(packet.motion->previous) != nullptr &&
      map_.root(packet.motion->previous) == map_.root(packet.reference)) {
    const Map::Ancestor from = map_.live_ancestor(packet.motion->previous);
    const MotionPrior& since = packet.motion->since;
    const bool rides = from.id != packet.motion->previous;
    k.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{
        from.id, rides ? joined(ride_on(from.cam_from_ancestor, kEssentialSharedPoints), since) : since});
  }
  // As uncertain as what it hangs on and the way from there, until adjustment knows better; where nothing ties it to
  // the map, it never does.
  if (packet.reference != kNoKeyframe)
    k.covariance = carried(packet.cam_from_reference, map_.keyframe(packet.reference)->covariance);
  if (k.motion) k.covariance += k.motion->since.covariance;
  k.planes = packet.planes;
  k.points = packet.points;
  const Rigid3 world_from_cam = k.cam_from_world.inverse();
  map_.add_keyframe(std::move(k));
  std::vector<PointId> born;
  for (const ProvisionalPoint& n : packet.new_points) {
    MapPoint p;
    p.id = n.id;
    p.position = world_from_cam * n.point_in_keyframe;
    const int feature = birth_feature(n.id);
    p.colour = packet.features->keypoints[static_cast<size_t>(feature)].colour;
    map_.add_point(std::move(p));
    map_.observe(n.id, packet.id, feature);
    born.push_back(n.id);
  }
  report_.points_created += static_cast<int>(born.size());
  young_.insert(young_.end(), born.begin(), born.end());
  refresh(map_.points_of({packet.id}));
  map_.update_covisibility(packet.id, kMinSharedPoints);
  const auto& covisible = map_.keyframe(packet.id)->covisible;
  if (!covisible.empty())
    map_.set_parent(packet.id, covisible.front().keyframe);
  else if (packet.reference != kNoKeyframe)
    map_.set_parent(packet.id, packet.reference);
}

void LocalMapper::cull_points(KeyframeId newest) {
  std::vector<PointId> still_young;
  for (PointId id : young_) {
    const MapPoint* p = map_.point(id);
    if (p == nullptr) continue;
    const int age = newest - birth_keyframe(id);
    const bool rarely_found = p->found < kMinFoundRatio * p->visible;
    const bool rarely_seen = age >= kProbationKeyframes && static_cast<int>(p->observations.size()) < kMinObservers;
    if (rarely_found || rarely_seen) {
      map_.remove_point(id);
      ++report_.points_culled;
    } else if (age < kProbationKeyframes) {
      still_young.push_back(id);
    }
  }
  young_ = std::move(still_young);
}

// The better observed point survives; the older one in a tie.
void LocalMapper::fuse_pair(PointId a, PointId b) {
  const size_t seen_a = map_.point(a)->observations.size(), seen_b = map_.point(b)->observations.size();
  if (seen_a > seen_b || (seen_a == seen_b && a < b))
    map_.fuse(b, a);
  else
    map_.fuse(a, b);
}

int LocalMapper::fuse_into(KeyframeId keyframe, const std::vector<PointId>& points, double tolerance) {
  std::vector<Candidate> candidates;
  for (PointId id : points) {
    const MapPoint* p = map_.point(id);
    if (p == nullptr) continue;
    const bool seen = std::any_of(p->observations.begin(), p->observations.end(),
                                  [&](const Observation& o) { return o.keyframe == keyframe; });
    if (!seen) candidates.push_back(candidate_of(*p));
  }
  const Keyframe& k = *map_.keyframe(keyframe);
  const ProjectionMatchOptions match{
      .radius = static_cast<float>(tolerance * kFusionRadius), .max_distance = 50, .ratio = 1.0f};
  const auto matches = match_by_projection(candidates, *k.features, optics_, k.cam_from_world, match, nullptr, nullptr);
  int fused = 0;
  const auto features = k.features;
  for (const ProjectionMatch& m : matches) {
    const PointId id = candidates[static_cast<size_t>(m.candidate)].id;
    const MapPoint* p = map_.point(id);
    if (p == nullptr) continue;
    const Keypoint& kp = features->keypoints[static_cast<size_t>(m.feature)];
    const Rigid3 cam_from_world = map_.keyframe(keyframe)->cam_from_world;
    const Eigen::Vector3d in_cam = cam_from_world * p->position;
    if ((optics_.camera.project(in_cam) - kp.pixel.cast<double>()).squaredNorm() >
        kChi2TwoDof95 * tolerance * tolerance * optics_.corner_variance(kp))
      continue;
    if (!may_show(kp, in_cam.z(), optics_.noise, tolerance)) continue;
    const PointId there = map_.keyframe(keyframe)->points[static_cast<size_t>(m.feature)];
    if (there == kNoPoint) {
      map_.observe(id, keyframe, m.feature);
    } else if (there != id) {
      fuse_pair(there, id);
      ++fused;
    }
  }
  return fused;
}

void LocalMapper::fuse_neighbours(KeyframeId id) {
  const std::vector<KeyframeId> neighbours = map_.best_covisible(id, kFusionKeyframes);
  for (KeyframeId n : neighbours) report_.points_fused += fuse_into(n, map_.points_of({id}));
  report_.points_fused += fuse_into(id, map_.points_of(neighbours));
}

void LocalMapper::cull_keyframes(KeyframeId newest) {
  const std::vector<Covisible> neighbours = map_.keyframe(newest)->covisible;
  for (const Covisible& c : neighbours) {
    const Keyframe* k = map_.live_keyframe(c.keyframe);
    if (k == nullptr || k->parent == kNoKeyframe) continue;
    const auto points = std::count_if(k->points.begin(), k->points.end(), [](PointId p) { return p != kNoPoint; });
    const double enough = options_.redundant_share * static_cast<double>(points);
    std::ptrdiff_t redundant = 0, left = points;
    for (size_t f = 0; f < k->points.size() && static_cast<double>(redundant + left) > enough; ++f) {
      const MapPoint* p = map_.point(k->points[f]);
      if (p == nullptr) continue;
      --left;
      if (static_cast<int>(p->observations.size()) <= kRedundantObservers) continue;
      const int octave = k->features->keypoints[f].octave;
      int as_fine = 0;
      for (size_t i = 0; i < p->observations.size() && as_fine < kRedundantObservers; ++i) {
        const Observation& o = p->observations[i];
        as_fine += o.keyframe != c.keyframe &&
                   map_.keyframe(o.keyframe)->features->keypoints[static_cast<size_t>(o.feature)].octave <= octave + 1;
      }
      redundant += as_fine >= kRedundantObservers;
    }
    if (points > 0 && static_cast<double>(redundant) > enough) {
      map_.cull_keyframe(c.keyframe);
      ++report_.keyframes_culled;
    }
  }
}

void LocalMapper::cull_if_empty(KeyframeId id) {
  const Keyframe* k = map_.live_keyframe(id);
  if (k == nullptr || k->parent == kNoKeyframe || (k->planes && !k->planes->patches.empty()) ||
      std::any_of(k->points.begin(), k->points.end(), [](PointId p) { return p != kNoPoint; }))
    return;
  map_.cull_keyframe(id);
  ++report_.keyframes_culled;
}

void LocalMapper::refresh(const std::vector<PointId>& points) {
  for (PointId id : points)
    if (map_.point(id) != nullptr) refresh_point(map_, id, optics_.scale_factor);
}

void refresh_point(Map& map, PointId id, double scale_factor) {
  const MapPoint& old = *map.point(id);
  if (old.observations.empty()) return;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Observation& o : old.observations)
    sum += (centre_in_world(map.keyframe(o.keyframe)->cam_from_world) - old.position).normalized();
  // The descriptor with the least median distance to the others stands for all; of many, some from all the time.
  const size_t seen = old.observations.size(), compared = std::min(seen, kCompared);
  const auto observation = [&](size_t i) -> const Observation& { return old.observations[i * seen / compared]; };
  std::array<Descriptor, kCompared> descriptors;
  for (size_t i = 0; i < compared; ++i) {
    const Observation& o = observation(i);
    descriptors[i] = map.keyframe(o.keyframe)->features->descriptors[static_cast<size_t>(o.feature)];
  }
  const size_t chosen = central_descriptor({descriptors.data(), compared});
  const Observation source = observation(chosen);
  const Keyframe& k = *map.keyframe(source.keyframe);
  const Descriptor descriptor = descriptors[chosen];
  const float distance = static_cast<float>((centre_in_world(k.cam_from_world) - old.position).norm());
  const float scale =
      static_cast<float>(std::pow(scale_factor, k.features->keypoints[static_cast<size_t>(source.feature)].octave));
  MapPoint& p = map.edit_point(id);
  p.normal = sum.normalized().cast<float>();
  p.descriptor = descriptor;
  p.reference_distance = distance;
  p.reference_scale = scale;
}

}  // namespace dkb
