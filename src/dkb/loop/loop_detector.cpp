// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/loop_detector.h"

#include <algorithm>
#include <cmath>
#include <queue>

namespace dkb {
namespace {

constexpr double kDegrees = 57.295779513082321;

// Candidates. All figures of this file: chosen on the simulated rounds and twins, docs/decisions.md.
constexpr int kNeighbourhood = 2;               // steps along covisibility that make a keyframe a neighbour
constexpr int kMaxCandidates = 4;               // most alike keyframes that are verified
constexpr double kMinRelativeSimilarity = 0.4;  // to a candidate, over that to the most alike neighbour
constexpr size_t kAreaKeyframes = 8;            // a candidate and its best covisible ones, whose points are matched
constexpr double kMinShare = 0.2;               // of the area's well-known points that ought to be in view

// Keyframes around the newest one that show the area just there as well.
constexpr int kSupportKeyframes = 8;             // asked at most
constexpr int kSupportInliers = 30;              // points of the area that such a keyframe must show
constexpr double kMaxSupportTranslation = 0.08;  // [m] by which they may differ
constexpr double kMaxSupportRotation = 3;        // [deg]

// What can have drifted along the shortest path through the map from the one keyframe to the other.
constexpr double kDriftTranslationBase = 0.2;    // [m]
constexpr double kDriftTranslationShare = 0.08;  // of the path's length
constexpr double kDriftRotationBase = 8;         // [deg]
constexpr double kDriftRotationPerMetre = 1.5;   // [deg/m]
constexpr double kMaxDriftRotation = 30;         // [deg] however long the path is

// Between maps that are not joined there is no path, and appearance alone decides.
constexpr int kMergeMinInliers = 80;
constexpr double kMergeMinShare = 0.3;

// Of the area's well-known points that ought to be in view.
double share_found(const Map& map, const MapArea& area, const PlaceFit& fit) {
  int expected = 0, found = 0;
  for (size_t i = 0; i < area.points.size(); ++i) {
    if (fit.sightings[i] == Sighting::out_of_view || !well_known(*map.point(area.points[i].id))) continue;
    ++expected;
    found += fit.sightings[i] == Sighting::found;
  }
  return expected > 0 ? static_cast<double>(found) / expected : 0;
}

bool supports(const Rigid3& expected_cam_from_world, const PlaceFit& fit) {
  const Rigid3 difference = fit.cam_from_world * expected_cam_from_world.inverse();
  return difference.translation.norm() <= kMaxSupportTranslation &&
         kDegrees * vector_from_rotation(difference.rotation).norm() <= kMaxSupportRotation;
}

// Keyframes around `id` that may tell the same: covisible ones and those made just before.
std::vector<KeyframeId> support_candidates(const Map& map, KeyframeId id, const std::vector<KeyframeId>& root_of) {
  std::vector<KeyframeId> chosen;
  const auto add = [&](KeyframeId k) {
    if (static_cast<int>(chosen.size()) < kSupportKeyframes && k != id && map.live_keyframe(k) != nullptr &&
        root_of[static_cast<size_t>(k)] == root_of[static_cast<size_t>(id)] &&
        std::find(chosen.begin(), chosen.end(), k) == chosen.end())
      chosen.push_back(k);
  };
  for (KeyframeId k = id - 1; k >= 0 && k >= id - (kSupportKeyframes + 1) / 2; --k) add(k);
  for (const Covisible& c : map.keyframe(id)->covisible) add(c.keyframe);
  return chosen;
}

// Null where nothing tells of the motion from one of them to the other.
const KeyframeMotion* motion_between(const Map& map, KeyframeId a, KeyframeId b) {
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)})
    if (const auto& motion = map.keyframe(to)->motion; motion && motion->previous == from) return motion.get();
  return nullptr;
}

// `id` and its neighbours; one flag per keyframe.
std::vector<uint8_t> neighbourhood_of(const Map& map, KeyframeId id) {
  std::vector<uint8_t> near(static_cast<size_t>(map.keyframe_count()), 0);
  std::vector<KeyframeId> rim = {id};
  near[static_cast<size_t>(id)] = 1;
  for (int s = 0; s < kNeighbourhood; ++s) {
    std::vector<KeyframeId> next;
    for (KeyframeId k : rim)
      for (const Covisible& c : map.keyframe(k)->covisible)
        if (!near[static_cast<size_t>(c.keyframe)]) {
          near[static_cast<size_t>(c.keyframe)] = 1;
          next.push_back(c.keyframe);
        }
    rim = std::move(next);
  }
  return near;
}

}  // namespace

std::vector<PathThroughMap> paths_through_map(const Map& map, KeyframeId from, const std::vector<KeyframeId>& to) {
  const auto count = static_cast<size_t>(map.keyframe_count());
  std::vector<PathThroughMap> paths(count);
  using Entry = std::pair<double, KeyframeId>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  paths[static_cast<size_t>(from)].length = 0;
  open.emplace(0.0, from);
  size_t wanted = to.size();
  while (!open.empty()) {
    const double path_length = open.top().first;
    const KeyframeId at = open.top().second;
    open.pop();
    const PathThroughMap path = paths[static_cast<size_t>(at)];
    if (path_length > path.length) continue;
    if (std::find(to.begin(), to.end(), at) != to.end() && --wanted == 0) break;
    const Keyframe& k = *map.keyframe(at);
    const Eigen::Vector3d centre = centre_in_world(k.cam_from_world);
    const auto go = [&](KeyframeId next, const KeyframeMotion* motion) {
      const double there = path_length + (centre_in_world(map.keyframe(next)->cam_from_world) - centre).norm();
      PathThroughMap& longer = paths[static_cast<size_t>(next)];
      if (there >= longer.length) return;
      longer = {there, path.position_variance, path.rotation_variance};
      if (motion != nullptr) {
        longer.position_variance += motion->since.covariance.topLeftCorner<3, 3>().trace();
        longer.rotation_variance += motion->since.covariance.bottomRightCorner<3, 3>().trace();
      }
      open.emplace(there, next);
    };
    for (const Covisible& c : k.covisible) go(c.keyframe, nullptr);
    for (KeyframeId child : k.children) go(child, motion_between(map, child, at));
    if (k.parent != kNoKeyframe) go(k.parent, motion_between(map, k.parent, at));
  }
  return paths;
}

DriftBound drift_bound(const PathThroughMap& path) {
  const double turned_sd = std::sqrt(path.rotation_variance);
  const double moved_sd = std::hypot(std::sqrt(path.position_variance), turned_sd * path.length);
  DriftBound bound;
  bound.translation = kDriftTranslationBase + kDriftTranslationShare * path.length + 3 * moved_sd;
  bound.rotation =
      std::min(kDriftRotationBase + kDriftRotationPerMetre * path.length, kMaxDriftRotation) + kDegrees * 3 * turned_sd;
  return bound;
}

std::optional<LoopFinding> find_loop(const Map& map, KeyframeId id, const Optics& optics, const LoopOptions& options,
                                     uint64_t seed) {
  const Keyframe* newest = map.live_keyframe(id);
  if (newest == nullptr) return std::nullopt;
  const std::vector<uint8_t> near = neighbourhood_of(map, id);
  const std::vector<KeyframeId> root_of = map.root_of_each();
  const KeyframeId root = root_of[static_cast<size_t>(id)];
  const auto eligible = [&](KeyframeId k) {
    return !near[static_cast<size_t>(k)] && (k <= id - kMinKeyframesBetween || root_of[static_cast<size_t>(k)] != root);
  };
  const std::vector<KeyframeId> live = map.live_keyframes();
  if (std::none_of(live.begin(), live.end(), eligible)) return std::nullopt;

  std::vector<KeyframeId> candidates;
  float neighbour_score = 0;
  std::vector<uint8_t> covered(near.size(), 0);  // by the area of a candidate that is more alike
  const auto similar = map.similar_keyframes(newest->features->descriptors, live.size());
  for (const PlaceMatch& m : similar)
    if (m.id != id && near[static_cast<size_t>(m.id)]) neighbour_score = std::max(neighbour_score, m.score);
  for (const PlaceMatch& m : similar) {
    if (!eligible(m.id) || covered[static_cast<size_t>(m.id)]) continue;
    if (m.score < kMinRelativeSimilarity * neighbour_score || static_cast<int>(candidates.size()) >= kMaxCandidates)
      break;
    candidates.push_back(m.id);
    for (KeyframeId k : map.best_covisible(m.id, kAreaKeyframes / 2)) covered[static_cast<size_t>(k)] = 1;
  }

  std::vector<PathThroughMap> paths;
  std::optional<LoopFinding> best;
  for (KeyframeId far : candidates) {
    const bool merge = root_of[static_cast<size_t>(far)] != root;
    const MapArea area = area_around(map, far, kAreaKeyframes);
    const auto located =
        fit_by_descriptors(area.points, *newest->features, optics, kMinPlaceMatches,
                           {.min_inliers = kMinPlaceMatches, .seed = seed + static_cast<uint64_t>(id)});
    if (!located) continue;
    if (!merge) {
      if (paths.empty()) paths = paths_through_map(map, id, candidates);
      const DriftBound drift = drift_bound(paths[static_cast<size_t>(far)]);
      const double shift = (centre_in_world(located->cam_from_world) - centre_in_world(newest->cam_from_world)).norm();
      const double rotation =
          kDegrees *
          vector_from_rotation(located->cam_from_world.rotation.conjugate() * newest->cam_from_world.rotation).norm();
      if (shift > drift.translation || rotation > drift.rotation) continue;
    }
    const auto fit = fit_by_projection(area.points, *newest->features, optics, located->cam_from_world, kSearchRadii);
    if (!fit || fit->inliers < (merge ? kMergeMinInliers : options.min_inliers) ||
        share_found(map, area, *fit) < (merge ? kMergeMinShare : kMinShare))
      continue;
    if (best && best->support.front().fit.inliers >= fit->inliers) continue;

    const Rigid3 far_world_from_world = fit->cam_from_world.inverse() * newest->cam_from_world;
    LoopFinding finding;
    finding.merge = merge;
    finding.far_area = area.keyframes;
    finding.support.push_back({id, *fit});
    for (KeyframeId supporter : support_candidates(map, id, root_of)) {
      const Keyframe& k = *map.keyframe(supporter);
      const Rigid3 expected = k.cam_from_world * far_world_from_world.inverse();
      auto seen = fit_by_projection(area.points, *k.features, optics, expected, kSearchRadii);
      if (seen && seen->inliers >= kSupportInliers && supports(expected, *seen))
        finding.support.push_back({supporter, std::move(*seen)});
    }
    if (static_cast<int>(finding.support.size()) > options.min_support) best = std::move(finding);
  }
  return best;
}

}  // namespace dkb
