// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/tsdf_volume.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <system_error>
#include <thread>

namespace dkb {
namespace {

constexpr int kMinViews = 2;          // keyframes that must see a surface
constexpr double kFreeShare = 0.08;   // of a voxel's keyframes that may have seen through it (docs/benchmarks.md)
constexpr int kAllocationStride = 2;  // view pixels: a block is much larger than what lies between them

uint64_t hash_of(const VoxelIndex& i) {
  uint64_t h = static_cast<uint32_t>(i.x) * 0x9E3779B97F4A7C15ULL;
  h = (h ^ (h >> 29)) + static_cast<uint32_t>(i.y) * 0xBF58476D1CE4E5B9ULL;
  h = (h ^ (h >> 31)) + static_cast<uint32_t>(i.z) * 0x94D049BB133111EBULL;
  h = (h ^ (h >> 30)) * 0xD6E8FEB86659FD93ULL;
  return h ^ (h >> 32);
}

// Blocks within `truncation` of the surface that a view sees, sorted.
std::vector<VoxelIndex> blocks_at_surface(const PlacedView& placed, const ViewCamera& camera,
                                          const DenseOptions& options) {
  const DepthView& view = *placed.view;
  const Rigid3 world_from_cam = placed.cam_from_world.inverse();
  const Eigen::Matrix3d r = world_from_cam.matrix3();
  const double block = options.voxel * VoxelBlock::kSide;
  // Places on a ray are no further apart than a block's side, or it would pass blocks unseen.
  const int steps = std::max(2, static_cast<int>(std::ceil(2 * options.truncation / block)));
  std::vector<VoxelIndex> result;
  for (int y = 0; y < view.depth.height(); y += kAllocationStride)
    for (int x = 0; x < view.depth.width(); x += kAllocationStride) {
      const double z = static_cast<double>(view.metres(x, y));
      if (!(z > 0) || z > options.max_depth) continue;
      const Eigen::Vector3d ray = r * camera.ray(x, y);
      for (int i = 0; i <= steps; ++i) {
        const double along = z + options.truncation * (2.0 * i / steps - 1);
        const Eigen::Vector3d p = (world_from_cam.translation + along * ray) / block;
        const VoxelIndex index{static_cast<int32_t>(std::floor(p.x())), static_cast<int32_t>(std::floor(p.y())),
                               static_cast<int32_t>(std::floor(p.z()))};
        if (result.empty() || result.back() != index) result.push_back(index);
      }
    }
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

// Blocks that at least `min_views` views see, by increasing index.
std::vector<VoxelIndex> blocks_to_fuse(std::span<const PlacedView> views, const ViewCamera& camera,
                                       const DenseOptions& options) {
  std::vector<VoxelIndex> seen, result;
  for (const PlacedView& view : views) {
    const std::vector<VoxelIndex> blocks = blocks_at_surface(view, camera, options);
    seen.insert(seen.end(), blocks.begin(), blocks.end());
  }
  std::sort(seen.begin(), seen.end());
  for (size_t i = 0, end = 0; i < seen.size(); i = end) {
    while (end < seen.size() && seen[end] == seen[i]) ++end;
    if (end - i >= kMinViews) result.push_back(seen[i]);
  }
  return result;
}

// What the views say of one block.
class BlockFuser {
 public:
  BlockFuser(std::span<const PlacedView> views, std::span<const Image<float>> facings, const ViewCamera& camera,
             const SensorNoise& noise, const DenseOptions& options)
      : views_(views), facings_(facings), camera_(camera), options_(options) {
    // What edges and registration add to a flat wall's noise is left out of the views, or averages out.
    const double nearest = noise.flat_depth_sigma(0.4);
    for (size_t i = 0; i < weight_of_depth_.size(); ++i) {
      const double s = nearest / noise.flat_depth_sigma(static_cast<double>(i) * kWeightStep);
      weight_of_depth_[i] = static_cast<float>(s * s);
    }
    for (const PlacedView& v : views) rotations_.push_back(v.cam_from_world.matrix3());
  }

  void fuse(VoxelBlock* block) {
    sums_.fill({});
    const double side = options_.voxel * VoxelBlock::kSide;
    const Eigen::Vector3d first =
        side * Eigen::Vector3d(block->index.x, block->index.y, block->index.z);  // centre of the first voxel
    const Eigen::Vector3d centre = first + Eigen::Vector3d::Constant(0.5 * (side - options_.voxel));
    for (size_t v = 0; v < views_.size(); ++v)
      if (visible(rotations_[v] * centre + views_[v].cam_from_world.translation))
        add_view(*views_[v].view, facings_[v], rotations_[v],
                 rotations_[v] * first + views_[v].cam_from_world.translation);
    for (size_t i = 0; i < sums_.size(); ++i) block->voxels[i] = result(sums_[i]);
  }

 private:
  struct Sums {
    float weight = 0, distance = 0, red = 0, green = 0, blue = 0;
    int hits = 0, seen_through = 0;
    float first = 0, last = 0;  // [s] of the hits, since the first view
  };
  static constexpr double kWeightStep = 0.05;  // [m]
  static constexpr float kMinFacing = 0.15F;   // depths of surfaces seen at a flatter angle are not worth much

  bool visible(const Eigen::Vector3d& centre) const {
    const double radius = 0.87 * options_.voxel * VoxelBlock::kSide;
    if (centre.z() < 0.05 || centre.z() - radius > options_.max_depth + 4.0) return false;
    const auto outside = [&](double across, double f, double c, int size) {
      const double low = c / f, high = (size - c) / f;
      return -across - low * centre.z() > radius * std::sqrt(1 + low * low) ||
             across - high * centre.z() > radius * std::sqrt(1 + high * high);
    };
    return !outside(centre.x(), camera_.fx, camera_.cx, camera_.width) &&
           !outside(centre.y(), camera_.fy, camera_.cy, camera_.height);
  }

  void add_view(const DepthView& view, const Image<float>& facing_of, const Eigen::Matrix3d& rotation,
                const Eigen::Vector3d& first) {
    const Eigen::Vector3f step_x = (rotation.col(0) * options_.voxel).cast<float>();
    const auto fx = static_cast<float>(camera_.fx), fy = static_cast<float>(camera_.fy);
    const auto cx = static_cast<float>(camera_.cx + 0.5), cy = static_cast<float>(camera_.cy + 0.5);
    const auto truncation = static_cast<float>(options_.truncation), max_depth = static_cast<float>(options_.max_depth);
    const auto width = static_cast<float>(camera_.width), height = static_cast<float>(camera_.height);
    const auto time = static_cast<float>(view.depth_time - views_.front().view->depth_time);
    Sums* sums = sums_.data();
    for (int k = 0; k < VoxelBlock::kSide; ++k)
      for (int j = 0; j < VoxelBlock::kSide; ++j) {
        const Eigen::Vector3f row =
            (first + options_.voxel * (j * rotation.col(1) + k * rotation.col(2))).cast<float>();
        for (int i = 0; i < VoxelBlock::kSide; ++i, ++sums) {
          const auto t = static_cast<float>(i);
          const float z = row.z() + t * step_x.z();
          if (z < 0.05F) continue;
          const float inverse = 1.0F / z;
          const float u = fx * (row.x() + t * step_x.x()) * inverse + cx;
          const float v = fy * (row.y() + t * step_x.y()) * inverse + cy;
          if (!(u >= 0 && v >= 0 && u < width && v < height)) continue;
          const int x = static_cast<int>(u), y = static_cast<int>(v);
          const float measured = view.metres(x, y);
          if (measured == 0) continue;
          const float distance = (measured - z) * facing_of(x, y);
          if (facing_of(x, y) < kMinFacing || distance < -truncation) continue;
          if (distance > truncation) {
            sums->seen_through += distance > 1.5F * truncation ? 1 : 0;
            continue;
          }
          if (measured > max_depth) continue;
          const float weight = weight_of_depth_[std::min(
              weight_of_depth_.size() - 1, static_cast<size_t>(measured * static_cast<float>(1 / kWeightStep)))];
          const Rgb colour = view.colour(x, y);
          sums->weight += weight;
          sums->distance += weight * distance;
          sums->red += weight * static_cast<float>(colour.r);
          sums->green += weight * static_cast<float>(colour.g);
          sums->blue += weight * static_cast<float>(colour.b);
          if (sums->hits++ == 0) sums->first = time;
          sums->last = time;
        }
      }
  }

  Voxel result(const Sums& s) const {
    Voxel voxel;
    voxel.known = s.hits >= kMinViews && s.last - s.first >= kStandsFor &&
                  s.seen_through <= kFreeShare * static_cast<double>(s.hits + s.seen_through);
    if (!voxel.known) return voxel;
    voxel.distance = s.distance / s.weight;
    const auto byte = [&](float sum) { return static_cast<uint8_t>(sum / s.weight + 0.5F); };
    voxel.colour = {byte(s.red), byte(s.green), byte(s.blue)};
    return voxel;
  }

  std::span<const PlacedView> views_;
  std::span<const Image<float>> facings_;
  ViewCamera camera_;
  DenseOptions options_;
  std::vector<Eigen::Matrix3d> rotations_;
  std::array<float, 512> weight_of_depth_{};
  std::array<Sums, VoxelBlock::kVoxels> sums_;
};

}  // namespace

TsdfVolume TsdfVolume::fuse(std::span<const PlacedView> views, const ViewCamera& camera, const SensorNoise& noise,
                            const DenseOptions& options) {
  TsdfVolume volume;
  volume.voxel_ = options.voxel;
  const std::vector<VoxelIndex> indices = blocks_to_fuse(views, camera, options);
  volume.blocks_.resize(indices.size());
  volume.table_.assign(std::bit_ceil(2 * indices.size() + 1), -1);
  const size_t mask = volume.table_.size() - 1;
  for (size_t i = 0; i < indices.size(); ++i) {
    volume.blocks_[i].index = indices[i];
    size_t slot = hash_of(indices[i]) & mask;
    while (volume.table_[slot] >= 0) slot = (slot + 1) & mask;
    volume.table_[slot] = static_cast<int32_t>(i);
  }
  std::vector<Image<float>> facings;
  for (const PlacedView& v : views) facings.push_back(facing(*v.view, camera));
  std::atomic<size_t> next{0};
  const auto work = [&] {
    BlockFuser fuser(views, facings, camera, noise, options);
    for (size_t i = next++; i < volume.blocks_.size(); i = next++) fuser.fuse(&volume.blocks_[i]);
  };
  std::vector<std::thread> helpers;
  try {
    for (int i = 1; i < options.threads; ++i) helpers.emplace_back(work);
  } catch (const std::system_error&) {  // the system has no more threads: those that there are do it all
  }
  work();
  for (std::thread& t : helpers) t.join();
  return volume;
}

int TsdfVolume::find(const VoxelIndex& block) const {
  if (table_.empty()) return -1;
  const size_t mask = table_.size() - 1;
  for (size_t slot = hash_of(block) & mask;; slot = (slot + 1) & mask) {
    const int32_t i = table_[slot];
    if (i < 0 || blocks_[static_cast<size_t>(i)].index == block) return i;
  }
}

}  // namespace dkb
