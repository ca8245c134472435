// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/rgbd_features.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dkb/features/vectorised.h"

namespace dkb {
namespace {

constexpr int kNodeSpacing = 8;  // [px]

struct Triple {
  float low, mid, high;
};

// Three depths from `p` on in order, what is not valid as 0.
inline Triple sorted(const float* p) {
  const auto valid = [](float d) { return d > 0 ? d : 0.0f; };
  const float a = valid(p[0]), b = valid(p[1]), c = valid(p[2]);
  const float low = std::min(a, b), high = std::max(a, b);
  return {std::min(low, c), std::max(low, std::min(high, c)), std::max(high, c)};
}

// The median of the valid 3 x 3 neighbours of a pixel; 0 where one of them is farther than `limit`.
float median_around(const DepthImage& depth, int x, int y, float limit) {
  const Triple a = sorted(&depth(x - 1, y - 1)), b = sorted(&depth(x - 1, y)), c = sorted(&depth(x - 1, y + 1));
  if (std::max({a.high, b.high, c.high}) > limit) return 0;
  if ((a.low > 0) & (b.low > 0) & (c.low > 0)) {
    // The median of nine: of the greatest low, the middle mid and the least high.
    const float low = std::max({a.low, b.low, c.low}), high = std::min({a.high, b.high, c.high});
    const float mid = std::max(std::min(a.mid, b.mid), std::min(std::max(a.mid, b.mid), c.mid));
    return std::max(std::min(low, mid), std::min(std::max(low, mid), high));
  }
  float values[9];
  int n = 0;
  for (const float d : {a.low, a.mid, a.high, b.low, b.mid, b.high, c.low, c.mid, c.high}) {
    if (!(d > 0)) continue;
    int at = n++;
    for (; at > 0 && values[at - 1] > d; --at) values[at] = values[at - 1];  // insertion keeps them sorted
    values[at] = d;
  }
  return n % 2 == 1 ? values[n / 2] : 0.5f * (values[n / 2 - 1] + values[n / 2]);
}

constexpr int kAcross = 2 * CornerDepths::kReach + 1;
constexpr int kSurface = 4;  // [px] fewer are no surface but noise
constexpr float kFar = std::numeric_limits<float>::infinity();

}  // namespace

CornerDepths::Depth CornerDepths::at(float x, float y) const {
  const int cx = static_cast<int>(std::lround(x)), cy = static_cast<int>(std::lround(y));
  if (cx < kReach || cy < kReach || cx >= depth_.width() - kReach || cy >= depth_.height() - kReach) return {};
  const float nearest = nearest_around(cx, cy);
  if (nearest == kFar) return {};
  const auto jump = [&](double pixels) { return static_cast<float>(noise_.max_depth_jump(nearest, pixels, focal_)); };
  const float limit = nearest + jump(kReach), centre = depth_(cx, cy);
  if (centre > 0 && centre <= limit)
    if (const float median = median_around(depth_, cx, cy, limit + jump(1)); median > 0) return {median, 0, {}};
  return nearest_pixel(cx, cy, limit);
}

float CornerDepths::nearest_around(int cx, int cy) const {
  float nearest = kFar;
  run_vectorised(simd_,
                 [first = &depth_(cx - kReach, cy - kReach), stride = depth_.width(), to = &nearest]() DKB_KERNEL_BODY {
                   // Nine columns as two times eight, so that a row is two registers.
                   static_assert(kAcross == 9);
                   using Eight = float __attribute__((vector_size(32)));
                   const Eight far = Eight{} + kFar;
                   Eight left = far, right = far;
                   for (int y = 0; y < kAcross; ++y) {
                     Eight here, beside;
                     __builtin_memcpy(&here, first + y * stride, sizeof here);
                     __builtin_memcpy(&beside, first + y * stride + 1, sizeof beside);
                     here = here > 0 ? here : far;
                     beside = beside > 0 ? beside : far;
                     left = here < left ? here : left;
                     right = beside < right ? beside : right;
                   }
                   left = left < right ? left : right;
                   float least = left[0];
                   for (int k = 1; k < 8; ++k) least = left[k] < least ? left[k] : least;
                   *to = least;
                 });
  return nearest;
}

// The depth, up to `limit`, that lies nearest in the image.
CornerDepths::Depth CornerDepths::nearest_pixel(int cx, int cy, float limit) const {
  int least = std::numeric_limits<int>::max(), count = 0;
  Depth found;
  for (int v = -kReach; v <= kReach; ++v)
    for (int u = -kReach; u <= kReach; ++u) {
      const float d = depth_(cx + u, cy + v);
      if (!(d > 0) || d > limit) continue;
      ++count;
      if (u * u + v * v >= least) continue;
      least = u * u + v * v;
      found = {0, d, {cx + u, cy + v}};
    }
  return count >= kSurface ? found : Depth();
}

UndistortionTable::UndistortionTable(const CameraModel& camera) {
  if (!camera.distorted()) return;
  identity_ = false;
  columns_ = (camera.width - 1) / kNodeSpacing + 2;
  rows_ = (camera.height - 1) / kNodeSpacing + 2;
  offset_.reserve(static_cast<size_t>(columns_ * rows_));
  for (int r = 0; r < rows_; ++r)
    for (int c = 0; c < columns_; ++c) {
      const Eigen::Vector2d pixel(c * kNodeSpacing, r * kNodeSpacing);
      offset_.push_back((camera.undistort(pixel) - pixel).cast<float>());
    }
}

Eigen::Vector2f UndistortionTable::operator()(float x, float y) const {
  if (identity_) return {x, y};
  const float gx = std::clamp(x / kNodeSpacing, 0.0f, static_cast<float>(columns_ - 1) - 1e-3f);
  const float gy = std::clamp(y / kNodeSpacing, 0.0f, static_cast<float>(rows_ - 1) - 1e-3f);
  const int c = static_cast<int>(gx), r = static_cast<int>(gy);
  const float fx = gx - static_cast<float>(c), fy = gy - static_cast<float>(r);
  const Eigen::Vector2f* node = &offset_[static_cast<size_t>(r * columns_ + c)];
  return Eigen::Vector2f(x, y) + (1 - fy) * ((1 - fx) * node[0] + fx * node[1]) +
         fy * ((1 - fx) * node[columns_] + fx * node[columns_ + 1]);
}

std::vector<Keypoint> keypoints_as_seen(const OrbFeatures& orb, const RgbdImage& image,
                                        const UndistortionTable& undistort, const CameraModel& camera,
                                        const SensorNoise& noise) {
  std::vector<Keypoint> keypoints(orb.corners.size());
  const CornerDepths depths(image.depth, camera, noise);
  // The images have mostly left the cache by now, and corners lie all over them.
  const auto ask_early = [&image](const Corner& c) {
    const int x = static_cast<int>(c.x), y = static_cast<int>(c.y);
    constexpr int kReach = CornerDepths::kReach;
    for (int row = std::max(0, y - kReach); row <= std::min(y + kReach, image.depth.height() - 1); ++row)
      __builtin_prefetch(&image.depth(x, row));
    if (!image.colour.empty()) __builtin_prefetch(&image.colour(x, y));
  };
  constexpr size_t kAhead = 12;  // [corners] as measured, docs/decisions.md
  for (size_t i = 0; i < orb.corners.size(); ++i) {
    if (i + kAhead < orb.corners.size()) ask_early(orb.corners[i + kAhead]);
    const Corner& c = orb.corners[i];
    Keypoint& k = keypoints[i];
    k.image_pixel = {c.x, c.y};
    k.pixel = undistort(c.x, c.y);
    k.angle = c.angle;
    k.response = c.response;
    k.place_sigma = c.place_sigma;
    k.octave = c.octave;
    const CornerDepths::Depth depth = depths.at(c.x, c.y);
    k.depth = depth.own;
    k.lent_depth = depth.lent;
    const int ix = std::clamp(static_cast<int>(std::lround(c.x)), 0, image.grey.width() - 1);
    const int iy = std::clamp(static_cast<int>(std::lround(c.y)), 0, image.grey.height() - 1);
    if (!image.colour.empty()) {
      k.colour = image.colour(ix, iy);
    } else {
      const uint8_t g = image.grey(ix, iy);
      k.colour = {g, g, g};
    }
  }
  return keypoints;
}

RgbdFeatures make_rgbd_features(std::vector<Descriptor> descriptors, std::vector<Keypoint> as_seen,
                                const RgbdImage& image, const CameraModel& camera, const SensorNoise& noise,
                                const Vector6d& velocity, const DepthOptions& options) {
  RgbdFeatures result;
  const CornerDepths depths(image.depth, camera, noise);
  result.descriptors = std::move(descriptors);
  result.keypoints = std::move(as_seen);
  const Rigid3 colour_cam_from_depth_cam = rigid3_from_tangent(velocity * (image.timestamp - image.depth_time(camera)));
  const Eigen::Matrix3d rotation = colour_cam_from_depth_cam.matrix3();
  const Eigen::Matrix3d back = rotation.transpose();
  const bool moved =
      options.model_time_offset && (colour_cam_from_depth_cam.translation.norm() > 1e-6 ||
                                    vector_from_rotation(colour_cam_from_depth_cam.rotation).norm() > 1e-6);
  const bool rolling = options.model_rolling_shutter && camera.readout != 0 && velocity.squaredNorm() > 0;
  for (Keypoint& k : result.keypoints) {
    float z = k.depth;
    if (moved && z > 0) {
      // Where was this surface point when the depth image was taken? Ask there, and carry the answer over.
      const Eigen::Vector3d now = camera.unproject(k.pixel.cast<double>(), z);
      const Eigen::Vector3d then = back * (now - colour_cam_from_depth_cam.translation);
      if (then.z() > 0.05) {
        const Eigen::Vector2d shift = camera.project(then) - k.pixel.cast<double>();
        const Eigen::Vector2f pixel_then = k.image_pixel + shift.cast<float>();
        const float z_then = depths.at(pixel_then.x(), pixel_then.y()).own;
        z = z_then > 0 ? static_cast<float>(
                             (rotation * (then * (z_then / then.z())) + colour_cam_from_depth_cam.translation).z())
                       : 0.0f;
      }
    }
    if (rolling) {
      const double early =
          (0.5 - k.image_pixel.y() / camera.height) * camera.readout;  // this row was exposed so long before the middle
      const Eigen::Vector3d seen = camera.unproject(k.pixel.cast<double>(), z > 0 ? z : 1.0);
      const Eigen::Vector3d turned =
          seen + early * (velocity.tail<3>().cross(seen) + (z > 0 ? 1.0 : 0.0) * velocity.head<3>());
      if (turned.z() > 0.05) {
        k.pixel = camera.project(turned).cast<float>();
        if (z > 0) z = static_cast<float>(turned.z());
      }
    }
    const auto in_range = [&camera](float d) {
      return d >= static_cast<float>(camera.depth_min) && d <= static_cast<float>(camera.depth_max);
    };
    k.depth = in_range(z) ? z : 0.0f;
    if (!in_range(k.lent_depth)) k.lent_depth = 0;
  }
  result.grid = KeypointGrid(result.keypoints, camera.width, camera.height);
  return result;
}

RgbdFeatures subset(const RgbdFeatures& features, const std::vector<int>& indices) {
  RgbdFeatures result;
  result.keypoints.reserve(indices.size());
  result.descriptors.reserve(indices.size());
  for (int i : indices) {
    const auto f = static_cast<size_t>(i);
    result.keypoints.push_back(features.keypoints[f]);
    result.descriptors.push_back(features.descriptors[f]);
  }
  result.grid = KeypointGrid(result.keypoints, features.grid);
  return result;
}

}  // namespace dkb
