// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/loop_detector.h"

#include <algorithm>
#include <limits>
#include <queue>

namespace dkb {
namespace {

constexpr double kDegrees = 57.295779513082321;

// How far the camera is from where it would be, and rotated, if the world moved as `moved_from_map`.
bool supports(const Rigid3& cam_from_world, const PlaceFit& fit, const Rigid3& fit_world_from_world, double translation,
              double rotation) {
  const Rigid3 expected = cam_from_world * fit_world_from_world.inverse();
  const Rigid3 difference = fit.cam_from_world * expected.inverse();
  return difference.translation.norm() <= translation &&
         kDegrees * vector_from_rotation(difference.rotation).norm() <= rotation;
}

// Keyframes that may support what `id` shows: covisible ones and those made just before.
std::vector<KeyframeId> support_candidates(const Map& map, KeyframeId id, int count) {
  std::vector<KeyframeId> chosen;
  const auto add = [&](KeyframeId k) {
    if (static_cast<int>(chosen.size()) < count && k != id && map.live_keyframe(k) != nullptr &&
        map.root(k) == map.root(id) && std::find(chosen.begin(), chosen.end(), k) == chosen.end())
      chosen.push_back(k);
  };
  for (KeyframeId k = id - 1; k >= 0 && k >= id - (count + 1) / 2; --k) add(k);
  for (const Covisible& c : map.keyframe(id)->covisible) add(c.keyframe);
  return chosen;
}

}  // namespace

std::vector<double> path_lengths_through_map(const Map& map, KeyframeId from) {
  const auto count = static_cast<size_t>(map.keyframe_count());
  std::vector<double> length(count, std::numeric_limits<double>::infinity());
  std::vector<std::vector<KeyframeId>> children(count);
  for (KeyframeId k : map.live_keyframes())
    if (map.keyframe(k)->parent != kNoKeyframe) children[static_cast<size_t>(map.keyframe(k)->parent)].push_back(k);
  using Entry = std::pair<double, KeyframeId>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  length[static_cast<size_t>(from)] = 0;
  open.emplace(0.0, from);
  while (!open.empty()) {
    const auto [path_length, at] = open.top();
    open.pop();
    if (path_length > length[static_cast<size_t>(at)]) continue;
    const Keyframe& k = *map.keyframe(at);
    const Eigen::Vector3d centre = centre_in_world(k.cam_from_world);
    const auto go = [&](KeyframeId next) {
      const double there = path_length + (centre_in_world(map.keyframe(next)->cam_from_world) - centre).norm();
      if (there >= length[static_cast<size_t>(next)]) return;
      length[static_cast<size_t>(next)] = there;
      open.emplace(there, next);
    };
    for (const Covisible& c : k.covisible) go(c.keyframe);
    for (KeyframeId child : children[static_cast<size_t>(at)]) go(child);
    if (k.parent != kNoKeyframe) go(k.parent);
  }
  return length;
}

std::vector<uint8_t> neighbourhood_of(const Map& map, KeyframeId id, int steps) {
  std::vector<uint8_t> near(static_cast<size_t>(map.keyframe_count()), 0);
  std::vector<KeyframeId> rim = {id};
  near[static_cast<size_t>(id)] = 1;
  for (int s = 0; s < steps; ++s) {
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

std::optional<LoopFinding> find_loop(const Map& map, KeyframeId id, const Optics& optics, const LoopOptions& options,
                                     uint64_t seed) {
  const Keyframe* newest = map.live_keyframe(id);
  if (newest == nullptr) return std::nullopt;
  const std::vector<uint8_t> near = neighbourhood_of(map, id, options.neighbourhood);
  const KeyframeId root = map.root(id);
  const auto eligible = [&](KeyframeId k) {
    return !near[static_cast<size_t>(k)] && (k <= id - options.min_keyframes_between || map.root(k) != root);
  };
  const std::vector<KeyframeId> live = map.live_keyframes();
  if (std::none_of(live.begin(), live.end(), eligible)) return std::nullopt;

  std::vector<KeyframeId> candidates;
  float neighbour_score = 0;
  std::vector<uint8_t> covered(near.size(), 0);  // by the area of a more similar candidate
  const auto similar = map.similar_keyframes(newest->features->descriptors, live.size());
  for (const PlaceMatch& m : similar)
    if (m.id != id && near[static_cast<size_t>(m.id)]) neighbour_score = std::max(neighbour_score, m.score);
  for (const PlaceMatch& m : similar) {
    if (!eligible(m.id) || covered[static_cast<size_t>(m.id)]) continue;
    if (m.score < options.min_relative_similarity * neighbour_score ||
        static_cast<int>(candidates.size()) >= options.candidates)
      break;
    candidates.push_back(m.id);
    const auto& covisible = map.keyframe(m.id)->covisible;
    for (size_t i = 0; i < std::min<size_t>(covisible.size(), static_cast<size_t>(options.area_keyframes / 2)); ++i)
      covered[static_cast<size_t>(covisible[i].keyframe)] = 1;
  }

  std::vector<double> path_lengths;
  std::optional<LoopFinding> best;
  for (KeyframeId far : candidates) {
    const bool merge = map.root(far) != root;
    const MapArea area = area_around(map, far, options.area_keyframes);
    const auto located = locate_in_area(map, id, area, optics, options, seed + static_cast<uint64_t>(id));
    if (!located) continue;
    if (!merge) {
      if (path_lengths.empty()) path_lengths = path_lengths_through_map(map, id);
      const double path_length = path_lengths[static_cast<size_t>(far)];
      const double shift = (centre_in_world(*located) - centre_in_world(newest->cam_from_world)).norm();
      const double rotation =
          kDegrees * vector_from_rotation(located->rotation.conjugate() * newest->cam_from_world.rotation).norm();
      if (shift > options.drift_translation_base + options.drift_translation_share * path_length ||
          rotation > options.drift_rotation_base + options.drift_rotation_per_metre * path_length)
        continue;
    }
    const auto fit = fit_to_area(map, id, *located, area, optics, options);
    if (!fit || static_cast<int>(fit->matches.size()) < (merge ? options.merge_min_inliers : options.min_inliers) ||
        fit->share() < (merge ? options.merge_min_share : options.min_share))
      continue;
    if (best && best->support.front().fit.matches.size() >= fit->matches.size()) continue;

    const Rigid3 far_world_from_world = fit->cam_from_world.inverse() * newest->cam_from_world;
    LoopFinding finding;
    finding.merge = merge;
    finding.far_area = area.keyframes;
    finding.support.push_back({id, *fit});
    for (KeyframeId supporter : support_candidates(map, id, options.support_keyframes)) {
      const Rigid3& own = map.keyframe(supporter)->cam_from_world;
      auto seen = fit_to_area(map, supporter, own * far_world_from_world.inverse(), area, optics, options);
      if (seen && static_cast<int>(seen->matches.size()) >= options.support_inliers &&
          supports(own, *seen, far_world_from_world, options.support_translation, options.support_rotation))
        finding.support.push_back({supporter, std::move(*seen)});
    }
    if (static_cast<int>(finding.support.size()) > options.min_support) best = std::move(finding);
  }
  return best;
}

}  // namespace dkb
