// SPDX-License-Identifier: Apache-2.0
#include "dkb/comparison/dynamic_filter.h"

#include <cmath>
#include <limits>

namespace dkb {
namespace {

// DKB eq. 13.
constexpr double kSpreadLimit = 8.0;          // s below which the narrow threshold holds
constexpr double kNarrow = 2.8, kWide = 9.0;  // delta there, and elsewhere

constexpr double kMaxEpipolarDistance = 1.0;  // [px] of what stands still
constexpr double kDepthJump = 0.4;  // [m] before what was seen there: something moved in (DynaSLAM, RA-L 2018)
constexpr double kRadius = 15;      // [px] features so near to such a spot and at its depth are dynamic too

// Distance [px] of the current pixel from the epipolar line of the previous one; 0 when the camera did not move.
double epipolar_distance(const FilterFeature& f, const CameraModel& camera, const Rigid3& current_from_previous) {
  if (current_from_previous.translation.norm() < 1e-6) return 0;
  const Eigen::Vector3d ray = camera.unproject(f.previous_pixel, 1.0);
  const Eigen::Vector3d line = skew(current_from_previous.translation) * (current_from_previous.rotation * ray);
  const Eigen::Vector3d line_px(line.x() / camera.fx, line.y() / camera.fy,
                                line.z() - line.x() * camera.cx / camera.fx - line.y() * camera.cy / camera.fy);
  const double norm = line_px.head<2>().norm();
  if (norm < 1e-12) return 0;
  return std::abs(line_px.x() * f.pixel.x() + line_px.y() * f.pixel.y() + line_px.z()) / norm;
}

// DKB eq. 9 after compensation of the camera's motion.
double flow_residual(const FilterFeature& f, const CameraModel& camera, const Rigid3& current_from_previous) {
  if (!(f.previous_depth > 0)) return epipolar_distance(f, camera, current_from_previous);
  const Eigen::Vector3d expected = current_from_previous * camera.unproject(f.previous_pixel, f.previous_depth);
  if (expected.z() < 0.05) return 0;
  return (camera.project(expected) - f.pixel).norm();
}

}  // namespace

std::vector<int> box_of_each(std::span<const FilterFeature> features, std::span<const Detection> boxes) {
  std::vector<int> box;
  for (const FilterFeature& f : features)
    box.push_back(smallest_box_at(boxes, static_cast<float>(f.image_pixel.x()), static_cast<float>(f.image_pixel.y())));
  return box;
}

DepthSpread depth_spread(std::span<const double> depths) {
  DepthSpread s;
  if (depths.size() < 5) return s;
  for (double d : depths) s.mean += d;
  s.mean /= static_cast<double>(depths.size());
  double all = 0, high = 0, low = 0;
  size_t highs = 0, lows = 0;
  for (double d : depths) {
    const double square = (d - s.mean) * (d - s.mean);
    all += square;
    if (d > s.mean) {
      high += square;
      ++highs;
    } else if (d < s.mean) {
      low += square;
      ++lows;
    }
  }
  s.sigma = std::sqrt(all / static_cast<double>(depths.size()));
  if (!(s.sigma > 1e-12)) return s;
  const double sigma_h = highs > 0 ? std::sqrt(high / static_cast<double>(highs)) : 0;
  const double sigma_l = lows > 0 ? std::sqrt(low / static_cast<double>(lows)) : 0;
  s.ratio = sigma_l > 0 ? sigma_h / sigma_l : std::numeric_limits<double>::infinity();
  s.delta = s.ratio < kSpreadLimit ? kNarrow : kWide;
  s.usable = true;
  return s;
}

std::vector<uint8_t> depth_test(std::span<const double> depths) {
  std::vector<uint8_t> dynamic(depths.size(), 0);
  const DepthSpread s = depth_spread(depths);
  if (!s.usable) return dynamic;
  for (size_t i = 0; i < depths.size(); ++i) {
    const double th = (depths[i] - s.mean) / s.sigma;
    dynamic[i] = th * th > s.delta;
  }
  return dynamic;
}

std::vector<uint8_t> paper_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                  const CameraModel& camera, const Rigid3& current_from_previous,
                                  const PaperFilterOptions& options) {
  std::vector<uint8_t> dynamic(features.size(), 0);
  const auto box = box_of_each(features, boxes);
  for (size_t i = 0; i < features.size(); ++i) {
    if (box[i] < 0 || !features[i].flowed) continue;
    const double distance = options.compensate ? flow_residual(features[i], camera, current_from_previous)
                                               : (features[i].pixel - features[i].previous_pixel).norm();
    dynamic[i] = distance > options.flow_threshold;
  }
  for (size_t b = 0; b < boxes.size(); ++b) {
    std::vector<double> depths;
    std::vector<size_t> index;
    for (size_t i = 0; i < features.size(); ++i)
      if (box[i] == static_cast<int>(b) && !dynamic[i] && features[i].depth > 0) {
        depths.push_back(features[i].depth);
        index.push_back(i);
      }
    const auto verdict = depth_test(depths);
    for (size_t k = 0; k < index.size(); ++k) dynamic[index[k]] = verdict[k];
  }
  return dynamic;
}

std::vector<uint8_t> epipolar_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                     const CameraModel& camera, const Rigid3& current_from_previous) {
  std::vector<uint8_t> dynamic(features.size(), 0);
  const auto box = box_of_each(features, boxes);
  for (size_t i = 0; i < features.size(); ++i)
    dynamic[i] = box[i] >= 0 && features[i].flowed &&
                 epipolar_distance(features[i], camera, current_from_previous) > kMaxEpipolarDistance;
  return dynamic;
}

std::vector<uint8_t> multiview_filter(std::span<const FilterFeature> features,
                                      std::span<const Eigen::Vector3d> seen_in_camera, const CameraModel& camera,
                                      const DepthImage& depth) {
  struct Spot {
    Eigen::Vector2d image_pixel;
    double depth;
  };
  std::vector<Spot> spots;
  for (const Eigen::Vector3d& p : seen_in_camera) {
    if (p.z() < 0.1) continue;
    const auto at = image_pixel(camera, p);
    if (!at) continue;
    const int x = static_cast<int>(std::lround(at->x())), y = static_cast<int>(std::lround(at->y()));
    if (!depth.contains(x, y)) continue;
    const double z = depth(x, y);
    if (z > 0 && p.z() - z > kDepthJump) spots.push_back({*at, z});
  }
  std::vector<uint8_t> dynamic(features.size(), 0);
  for (size_t i = 0; i < features.size(); ++i)
    for (const Spot& s : spots) {
      if ((s.image_pixel - features[i].image_pixel).squaredNorm() > kRadius * kRadius) continue;
      if (features[i].depth > 0 && std::abs(features[i].depth - s.depth) > 0.5 * kDepthJump) continue;
      dynamic[i] = 1;
      break;
    }
  return dynamic;
}

}  // namespace dkb
