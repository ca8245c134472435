// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/point_creation.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dkb/util/chi_square.h"

namespace dkb {
namespace {

constexpr size_t kTriangulated = 6;   // covisible keyframes to triangulate with
constexpr double kMinParallax = 1.0;  // [deg] between the rays of a new point
constexpr int kMaxDistance = 50;      // [bits] largest Hamming distance of an epipolar match

// Point nearest to two rays, from the least squares of both; nothing when they are parallel or it lies behind.
std::optional<Eigen::Vector3d> meet(const Eigen::Vector3d& centre_a, const Eigen::Vector3d& ray_a,
                                    const Eigen::Vector3d& centre_b, const Eigen::Vector3d& ray_b) {
  const double ab = ray_a.dot(ray_b);
  const double denominator = 1.0 - ab * ab;
  if (denominator < 1e-9) return std::nullopt;
  const Eigen::Vector3d base = centre_b - centre_a;
  const double s = (base.dot(ray_a) - ab * base.dot(ray_b)) / denominator;
  const double t = (ab * base.dot(ray_a) - base.dot(ray_b)) / denominator;
  if (s <= 0 || t <= 0) return std::nullopt;
  return 0.5 * (centre_a + s * ray_a + centre_b + t * ray_b);
}

// A feature without a map point, and how far from an epipolar line it may lie.
struct FreeFeature {
  int feature = 0;
  double x = 0, y = 0;  // [px]
  double limit = 0;     // [px^2]
};

std::vector<FreeFeature> free_features(const Keyframe& keyframe, double chi2, const Optics& optics) {
  std::vector<FreeFeature> free;
  for (size_t f = 0; f < keyframe.points.size(); ++f) {
    if (keyframe.points[f] != kNoPoint) continue;
    const Keypoint& k = keyframe.features->keypoints[f];
    free.push_back({static_cast<int>(f), k.pixel.x(), k.pixel.y(), chi2 * optics.corner_variance(k)});
  }
  return free;
}

struct DescriptorMatch {
  int feature = -1, distance = 0;
};

// The most similar of the free features near a line [px], of those within `max_distance` bits.
DescriptorMatch best_on_line(const Eigen::Vector3d& line, const Descriptor& descriptor,
                             const std::vector<FreeFeature>& free, const RgbdFeatures& features, int max_distance) {
  DescriptorMatch best{-1, max_distance + 1};
  const double norm2 = line.head<2>().squaredNorm();
  if (norm2 < 1e-18) return best;
  for (const FreeFeature& f : free) {
    const double e = line.x() * f.x + line.y() * f.y + line.z();
    if (e * e > f.limit * norm2) continue;
    const int d = hamming_distance(descriptor, features.descriptors[static_cast<size_t>(f.feature)]);
    if (d < best.distance) best = {f.feature, d};
  }
  return best;
}

}  // namespace

std::vector<PointId> triangulate_new_points(Map& map, KeyframeId newest, const Optics& optics) {
  std::vector<PointId> made;
  const std::vector<Covisible> neighbours = map.keyframe(newest)->covisible;
  const double max_cosine = std::cos(kMinParallax * M_PI / 180);
  const CameraModel& camera = optics.camera;
  for (size_t n = 0; n < std::min(neighbours.size(), kTriangulated); ++n) {
    const Keyframe& a = *map.keyframe(newest);
    const Keyframe& b = *map.keyframe(neighbours[n].keyframe);
    const Rigid3 world_from_a = a.cam_from_world.inverse(), world_from_b = b.cam_from_world.inverse();
    const Rigid3 b_from_a = b.cam_from_world * world_from_a;
    if (b_from_a.translation.norm() < 0.02) continue;  // [m] nothing can be triangulated over so short a base
    const Eigen::Matrix3d rotation_b_from_a = b_from_a.matrix3();
    const Eigen::Matrix3d essential = skew(b_from_a.translation) * rotation_b_from_a;
    const std::vector<FreeFeature> free_b = free_features(b, kChi2OneDof95, optics);
    struct Found {
      int feature_a, feature_b, distance;
      Eigen::Vector3d point;
    };
    std::vector<Found> found;
    for (size_t fa = 0; fa < a.points.size(); ++fa) {
      if (a.points[fa] != kNoPoint) continue;
      const Keypoint& ka = a.features->keypoints[fa];
      if (ka.depth > 0) continue;  // what has depth was made from depth, or left out for a reason
      const Eigen::Vector3d ray_a = camera.unproject(ka.pixel.cast<double>(), 1.0);
      const Eigen::Vector3d line = essential * ray_a;  // in normalised coordinates of b
      const Eigen::Vector3d line_px(line.x() / camera.fx, line.y() / camera.fy,
                                    line.z() - line.x() * camera.cx / camera.fx - line.y() * camera.cy / camera.fy);
      const DescriptorMatch best =
          best_on_line(line_px, a.features->descriptors[fa], free_b, *b.features, kMaxDistance);
      if (best.feature < 0) continue;
      const Keypoint& kb = b.features->keypoints[static_cast<size_t>(best.feature)];
      const Eigen::Vector3d world_ray_a = (world_from_a.rotation * ray_a).normalized();
      const Eigen::Vector3d world_ray_b =
          (world_from_b.rotation * camera.unproject(kb.pixel.cast<double>(), 1.0)).normalized();
      if (world_ray_a.dot(world_ray_b) > max_cosine) continue;
      const auto point = meet(world_from_a.translation, world_ray_a, world_from_b.translation, world_ray_b);
      if (!point) continue;
      const auto fits = [&](const Rigid3& cam_from_world, const Keypoint& k) {
        const Eigen::Vector3d in_cam = cam_from_world * *point;
        if (in_cam.z() < 0.1) return false;
        if ((camera.project(in_cam) - k.pixel.cast<double>()).squaredNorm() > kChi2TwoDof95 * optics.corner_variance(k))
          return false;
        return may_show(k, in_cam.z(), optics.noise);
      };
      if (!fits(a.cam_from_world, ka) || !fits(b.cam_from_world, kb)) continue;
      found.push_back({static_cast<int>(fa), best.feature, best.distance, *point});
    }
    // One new point per feature of b: the best match takes it.
    std::stable_sort(found.begin(), found.end(),
                     [](const Found& x, const Found& y) { return x.distance < y.distance; });
    const KeyframeId id_b = neighbours[n].keyframe;
    for (const Found& f : found) {
      if (map.keyframe(id_b)->points[static_cast<size_t>(f.feature_b)] != kNoPoint) continue;
      MapPoint p;
      p.id = make_point_id(newest, f.feature_a);
      p.position = f.point;
      p.colour = map.keyframe(newest)->features->keypoints[static_cast<size_t>(f.feature_a)].colour;
      const PointId id = p.id;
      map.add_point(std::move(p));
      map.observe(id, newest, f.feature_a);
      map.observe(id, id_b, f.feature_b);
      made.push_back(id);
    }
  }
  std::sort(made.begin(), made.end());
  return made;
}

}  // namespace dkb
