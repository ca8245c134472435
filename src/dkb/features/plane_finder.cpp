// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/plane_finder.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dkb {
namespace {

constexpr int kBlock = PlaneView::kBlock;
constexpr int kStep = 4;  // [px] between the depths that are looked at
constexpr int kSide = kBlock / kStep, kDepths = kSide * kSide;
constexpr int kEnoughDepths = 3 * kDepths / 4;
// Times the sensor's variance, by which the depths of a block may be off: 2.65 is exceeded by one block in a thousand
// with 13 degrees of freedom, and real sensors' noise hangs together.
constexpr double kFlat = 3;
constexpr size_t kEnoughBlocks = 12;  // 1 % of an image of 640 x 480 pixels
constexpr size_t kMostPatches = std::numeric_limits<uint8_t>::max();

int pixel_of(int block, int sample) {
  return kBlock * block + kStep * sample + kStep / 2;
}

}  // namespace

void PlaneFinder::Moments::add(const Moments& other) {
  rays += other.rays;
  products += other.products;
  squares += other.squares;
  depths += other.depths;
}

double PlaneFinder::Moments::misfit(const Eigen::Vector3d& p) const {
  return std::max(0.0, squares - 2 * p.dot(products) + p.dot(rays * p));
}

PlaneFinder::PlaneFinder(const CameraModel& camera, const SensorNoise& noise)
    : noise_(noise), width_(camera.width / kBlock), height_(camera.height / kBlock) {
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x)
      for (int i = 0; i < kDepths; ++i) {
        const Eigen::Vector2d pixel(pixel_of(x, i % kSide), pixel_of(y, i / kSide));
        const Eigen::Vector3d ray = camera.unproject(camera.undistort(pixel), 1);
        x_.push_back(static_cast<float>(ray.x()));
        y_.push_back(static_cast<float>(ray.y()));
      }
  blocks_.resize(static_cast<size_t>(width_) * static_cast<size_t>(height_));
}

PlaneFinder::Block PlaneFinder::measure(const DepthImage& depth, int bx, int by) const {
  Block block;
  const size_t first = static_cast<size_t>(by * width_ + bx) * kDepths;
  double n = 0, z_sum = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, sw = 0, sxw = 0, syw = 0, sww = 0;
  for (int i = 0; i < kDepths; ++i) {
    const float z = depth(pixel_of(bx, i % kSide), pixel_of(by, i / kSide));
    if (!(z > 0)) continue;
    const double x = x_[first + static_cast<size_t>(i)], y = y_[first + static_cast<size_t>(i)], w = 1.0 / z;
    n += 1, z_sum += z;
    sx += x, sy += y, sxx += x * x, sxy += x * y, syy += y * y;
    sw += w, sxw += x * w, syw += y * w, sww += w * w;
  }
  if (n < kEnoughDepths) return block;
  const double z = z_sum / n, sigma = noise_.flat_depth_sigma(z) / (z * z), weight = 1 / (sigma * sigma);
  Moments& m = block.moments;
  m.rays << sxx, sxy, sx, sxy, syy, sy, sx, sy, n;
  m.products << sxw, syw, sw;
  m.rays *= weight;
  m.products *= weight;
  m.squares = weight * sww;
  m.depths = static_cast<int>(n);
  block.over_distance = m.rays.inverse() * m.products;
  block.misfit = m.misfit(block.over_distance) / (n - 3);
  block.flat = block.over_distance.allFinite() && block.misfit < kFlat;
  return block;
}

// The blocks around that the plane explains as well, by what is known of it so far.
PlaneFinder::Region PlaneFinder::grow(int seed) {
  const Block& start = blocks_[static_cast<size_t>(seed)];
  Region region{{seed}, start.moments, start.over_distance, start.moments.rays.inverse()};
  blocks_[static_cast<size_t>(seed)].taken = true;
  for (size_t next = 0; next < region.blocks.size(); ++next) {
    const int at_x = region.blocks[next] % width_, at_y = region.blocks[next] / width_;
    constexpr int kAround[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    for (const auto& [dx, dy] : kAround) {
      const int x = at_x + dx, y = at_y + dy;
      if (x < 0 || y < 0 || x >= width_ || y >= height_) continue;
      Block& block = blocks_[static_cast<size_t>(y * width_ + x)];
      if (block.taken || !block.flat) continue;
      const Moments& m = block.moments;
      const Eigen::Vector3d ray = m.rays.col(2) / m.weight();
      const double doubt = m.weight() / m.depths * ray.dot(region.covariance * ray);
      if (m.misfit(region.over_distance) > kFlat * m.depths * (1 + doubt)) continue;
      block.taken = true;
      region.blocks.push_back(y * width_ + x);
      region.moments.add(m);
      region.covariance = region.moments.rays.inverse();
      region.over_distance = region.covariance * region.moments.products;
    }
  }
  return region;
}

PlanePatch PlaneFinder::patch_of(const Region& region) const {
  PlanePatch patch;
  patch.over_distance = region.over_distance;
  // How much more the depths of a block vary together than by the sensor's noise: see HangingTogether in
  // dynamics/depth_alignment, to which one block of nothing but noise is added as well.
  double together = 1;
  for (const int b : region.blocks) {
    const Moments& m = blocks_[static_cast<size_t>(b)].moments;
    const double offset = m.offset(region.over_distance);
    together += offset * offset / m.weight();
  }
  patch.covariance = together / static_cast<double>(region.blocks.size() + 1) * region.covariance;
  const Eigen::Vector3d ray = region.moments.rays.col(2) / region.moments.weight();
  patch.centre = ray / patch.over_distance.dot(ray);
  return patch;
}

PlaneView PlaneFinder::find(const DepthImage& depth, const MoverMask& movers, const Rigid3& cam_from_depth_cam) {
  PlaneView view;
  view.patch_at = Image<uint8_t>(width_, height_);
  std::vector<int> seeds;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      Block& block = blocks_[static_cast<size_t>(y * width_ + x)];
      block = movers.at(kBlock * (x + 0.5f), kBlock * (y + 0.5f)) ? Block() : measure(depth, x, y);
      if (block.flat) seeds.push_back(y * width_ + x);
    }
  const auto misfit = [this](int block) { return blocks_[static_cast<size_t>(block)].misfit; };
  std::stable_sort(seeds.begin(), seeds.end(), [&](int a, int b) { return misfit(a) < misfit(b); });
  const Eigen::Matrix3d turn = cam_from_depth_cam.matrix3();
  for (const int seed : seeds) {
    if (blocks_[static_cast<size_t>(seed)].taken || view.patches.size() == kMostPatches) continue;
    const Region region = grow(seed);
    if (region.blocks.size() < kEnoughBlocks) {
      // Too small from here; another seed may take its blocks.
      for (const int b : region.blocks) blocks_[static_cast<size_t>(b)].taken = b == seed;
      continue;
    }
    PlanePatch patch = patch_of(region);
    if (!patch.covariance.allFinite() || !(patch.centre.z() > 0)) continue;
    const Eigen::Vector3d normal = turn * patch.normal();
    patch.over_distance = normal / (patch.distance() + normal.dot(cam_from_depth_cam.translation));
    patch.covariance = turn * patch.covariance * turn.transpose();
    patch.centre = cam_from_depth_cam * patch.centre;
    view.patches.push_back(patch);
    for (const int b : region.blocks) view.patch_at(b % width_, b / width_) = static_cast<uint8_t>(view.patches.size());
  }
  return view;
}

}  // namespace dkb
