// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <compare>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/dense/dense_options.h"
#include "dkb/dense/depth_view.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"

namespace dkb {

// Corner of the grid: voxel (i, j, k) has its centre at voxel * (i, j, k) in the world.
struct VoxelIndex {
  int32_t x = 0, y = 0, z = 0;
  auto operator<=>(const VoxelIndex&) const = default;
};

struct Voxel {
  float distance = 0;  // [m] to the nearest surface, positive on the side that was seen through
  Rgb colour;
  bool known = false;  // enough views agree that a still surface is near
};

// Cube of voxels that shares a look-up.
struct VoxelBlock {
  static constexpr int kSide = 8;
  static constexpr int kVoxels = kSide * kSide * kSide;
  static int at(int x, int y, int z) { return (z * kSide + y) * kSide + x; }
  VoxelIndex index;  // of the block: its first voxel is kSide * index
  std::array<Voxel, kVoxels> voxels;
};

// [s] From the first to the last view of what stands somewhere. Who walks at 1.2 m/s has left by then: a body is less
// than 0.25 m deep.
inline constexpr float kStandsFor = 0.2F;

// A view with its place in the finished map.
struct PlacedView {
  const DepthView* view = nullptr;
  Rigid3 cam_from_world;  // at the time of the depth image
};

// Truncated signed distances to the still surfaces (Curless, Levoy 1996, "A volumetric method for building complex
// models from range images"; blocks found by hashing as in Niessner et al. 2013, "Real-time 3D reconstruction at scale
// using voxel hashing"). Immutable once made.
class TsdfVolume {
 public:
  TsdfVolume() = default;

  // Fuses the views. Every view counts by the inverse variance of its depth. Blocks are made where a view sees a
  // surface, and every view then looks at all of them, whatever their order: what was a surface in some views and free
  // space in more than 8% of them is not known, so that a person who slipped through the mask once is carved
  // out by views from before and after. Nor is what was a surface for less than 0.2 s, as people are in the first
  // frames, before their motion can be told. Views are in the order of their time. Deterministic, also in the number of
  // threads.
  static TsdfVolume fuse(std::span<const PlacedView> views, const ViewCamera& camera, const SensorNoise& noise,
                         const DenseOptions& options);

  double voxel() const { return voxel_; }                            // [m]
  const std::vector<VoxelBlock>& blocks() const { return blocks_; }  // by increasing index
  // Position of a block in blocks(); -1 = there is none.
  int find(const VoxelIndex& block) const;

 private:
  double voxel_ = 0.02;
  std::vector<VoxelBlock> blocks_;
  std::vector<int32_t> table_;  // open addressing, block numbers; -1 = free
};

}  // namespace dkb
