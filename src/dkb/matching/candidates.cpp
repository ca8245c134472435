// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace dkb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kMinViewCosine = 0.5f;  // between the viewing ray and the point's mean direction

float angle_between(float a, float b) {
  const float d = std::fabs(a - b);
  return d > kPi ? 2 * kPi - d : d;
}

}  // namespace

Candidate candidate_of(const MapPoint& point) {
  return {point.id, point.position,   point.normal, point.reference_distance, point.reference_scale,
          -1.0f,    point.descriptor, false};
}

std::vector<Candidate> candidates_of(const Map& map, const std::vector<PointId>& live_points) {
  std::vector<Candidate> candidates;
  candidates.reserve(live_points.size());
  for (PointId id : live_points) candidates.push_back(candidate_of(*map.point(id)));
  return candidates;
}

Candidate candidate_of(const RgbdFeatures& features, size_t feature, const Eigen::Vector3d& position, double distance,
                       const Optics& optics) {
  const Keypoint& k = features.keypoints[feature];
  Candidate c;
  c.position = position;
  c.normal.setZero();
  c.reference_distance = static_cast<float>(distance);
  c.reference_scale = optics.scale(k.octave);
  c.angle = k.angle;
  c.descriptor = features.descriptors[feature];
  return c;
}

std::vector<ProjectionMatch> match_by_projection(const std::vector<Candidate>& candidates,
                                                 const MatchableFeatures& matchable, const Optics& optics,
                                                 const Rigid3& cam_from_world, const ProjectionMatchOptions& options,
                                                 const std::vector<uint8_t>* taken, std::vector<uint8_t>* visible,
                                                 const std::vector<uint8_t>* skipped) {
  const RgbdFeatures& features = matchable.features;
  const CameraModel& camera = optics.camera;
  const double scale_factor = optics.scale_factor;
  const Eigen::Matrix3f rotation = cam_from_world.matrix3().cast<float>();
  const Eigen::Vector3f translation = cam_from_world.translation.cast<float>();
  const Eigen::Vector3f centre = centre_in_world(cam_from_world).cast<float>();
  const float fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const float cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  const bool distorted = camera.distorted();
  const float width = static_cast<float>(camera.width), height = static_cast<float>(camera.height);
  std::array<float, 32> boundary{};  // level l is the nearest while the scale is below boundary[l]
  for (int l = 0; l < 32; ++l) boundary[static_cast<size_t>(l)] = static_cast<float>(std::pow(scale_factor, l + 0.5));
  const float nearest_scale = 1.0f / static_cast<float>(std::pow(scale_factor, 1.5));
  const float farthest_scale = static_cast<float>(std::pow(scale_factor, optics.levels + 0.5));

  std::vector<ProjectionMatch> best_of_feature(features.size());
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (skipped != nullptr && (*skipped)[i]) continue;
    const Candidate& c = candidates[i];
    const Eigen::Vector3f world = c.position.cast<float>();
    const Eigen::Vector3f p = rotation * world + translation;
    if (p.z() < 0.05f) continue;
    const float inv_z = 1.0f / p.z();
    const float u = fx * p.x() * inv_z + cx, v = fy * p.y() * inv_z + cy;
    if (!distorted && !(u >= 0 && v >= 0 && u < width && v < height)) continue;
    const Eigen::Vector3f ray = centre - world;
    const float distance = ray.norm();
    const float scale = c.reference_scale * c.reference_distance / distance;
    if (scale < nearest_scale || scale > farthest_scale) continue;
    if (c.normal.squaredNorm() > 0 && ray.dot(c.normal) < kMinViewCosine * distance) continue;
    // After what is cheaper: a lens takes more than all the rest.
    if (distorted && !optics.well_in_view(u, v) && !pixel_in_view(camera, p.cast<double>())) continue;
    if (visible != nullptr) (*visible)[i] = 1;
    // Counted rather than looked for: which it is, no processor foresees.
    int level = 0;
    for (int l = 0; l < optics.levels - 1; ++l) level += scale > boundary[static_cast<size_t>(l)] ? 1 : 0;
    const float radius = options.radius * optics.scale(level);
    int best = 256, second = 256, best_feature = -1, best_level = -1, second_level = -1;
    features.grid.for_each_near({u, v, radius, level - 1, level + 1}, [&](int f) {
      const Keypoint& k = features.keypoints[static_cast<size_t>(f)];
      if (p.z() < k.lent_depth && !may_show(k, p.z(), optics.noise)) return;
      if (matchable.on_mover(static_cast<size_t>(f)) &&
          (!c.established || (k.depth > 0 && !optics.noise.same_surface(k.depth, p.z()))))
        return;
      if (taken != nullptr && (*taken)[static_cast<size_t>(f)]) return;
      const int d = hamming_distance(c.descriptor, features.descriptors[static_cast<size_t>(f)]);
      if (d < best) {
        second = best;
        second_level = best_level;
        best = d;
        best_level = k.octave;
        best_feature = f;
      } else if (d < second) {
        second = d;
        second_level = k.octave;
      }
    });
    if (best_feature < 0 || best > options.max_distance) continue;
    if (second_level == best_level && static_cast<float>(best) > options.ratio * static_cast<float>(second)) continue;
    if (c.angle >= 0 && angle_between(c.angle, features.keypoints[static_cast<size_t>(best_feature)].angle) > 0.6f)
      continue;
    ProjectionMatch& match = best_of_feature[static_cast<size_t>(best_feature)];
    if (best < match.distance) match = {best_feature, static_cast<int>(i), best};
  }
  std::vector<ProjectionMatch> result;
  result.reserve(std::min(candidates.size(), features.size()));
  for (const ProjectionMatch& m : best_of_feature)
    if (m.feature >= 0) result.push_back(m);
  return result;
}

}  // namespace dkb
