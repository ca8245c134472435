// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/tsdf_volume.h"

#include <gtest/gtest.h>

#include "dkb/dense/dense_test_scene.h"

namespace dkb {
namespace {

using testing::DenseScene;
using testing::scene_camera;
using testing::scene_options;
using testing::scene_pose;

struct Views {
  std::vector<DepthView> views;
  std::vector<PlacedView> placed;
  ViewCamera camera;
};

// The person stands in the scene in the views of `with_person`.
Views make_views(int count, const std::vector<int>& with_person, const DenseOptions& options = scene_options(),
                 double interval = 0.25) {
  Views v;
  const DepthViewMaker maker(scene_camera(), options);
  v.camera = maker.camera();
  for (int i = 0; i < count; ++i) {
    DenseScene scene;
    if (std::find(with_person.begin(), with_person.end(), i) != with_person.end()) scene.person.emplace(-0.4, 2.2);
    v.views.push_back(maker.make(i, scene.draw(scene_camera(), scene_pose(i), interval * i), interval * i, {}));
  }
  for (int i = 0; i < count; ++i) v.placed.push_back({&v.views[static_cast<size_t>(i)], scene_pose(i).inverse()});
  return v;
}

TsdfVolume fuse(const Views& v, const DenseOptions& options = scene_options()) {
  return TsdfVolume::fuse(v.placed, v.camera, {}, options);
}

// Known voxels within one voxel of a zero crossing of the distance, as positions.
std::vector<Eigen::Vector3d> near_surface(const TsdfVolume& volume) {
  std::vector<Eigen::Vector3d> points;
  for (const VoxelBlock& block : volume.blocks())
    for (int z = 0; z < VoxelBlock::kSide; ++z)
      for (int y = 0; y < VoxelBlock::kSide; ++y)
        for (int x = 0; x < VoxelBlock::kSide; ++x) {
          const Voxel& voxel = block.voxels[static_cast<size_t>(VoxelBlock::at(x, y, z))];
          if (voxel.known && std::abs(voxel.distance) < 0.5 * volume.voxel())
            points.emplace_back(volume.voxel() *
                                (Eigen::Vector3d(block.index.x, block.index.y, block.index.z) * VoxelBlock::kSide +
                                 Eigen::Vector3d(x, y, z)));
        }
  return points;
}

bool on_person(const Eigen::Vector3d& p) {
  return std::abs(std::hypot(p.x() + 0.4, p.z() - 2.2) - 0.25) < 0.06 && p.y() < 1.1 && p.y() > -0.6;
}

size_t count_on_person(const TsdfVolume& volume) {
  const auto points = near_surface(volume);
  return static_cast<size_t>(std::count_if(points.begin(), points.end(), on_person));
}

TEST(TsdfVolume, NothingFromNoViews) {
  const TsdfVolume volume = TsdfVolume::fuse({}, {}, {}, {});
  EXPECT_TRUE(volume.blocks().empty());
  EXPECT_EQ(volume.find({0, 0, 0}), -1);
  EXPECT_EQ(TsdfVolume().find({0, 0, 0}), -1);
}

TEST(TsdfVolume, WhatWasSeenForAMomentIsNotKnown) {
  // Three views within 0.1 s: somebody who walks is still there in the last of them.
  EXPECT_TRUE(near_surface(fuse(make_views(3, {}, scene_options(), 0.05))).empty());
  EXPECT_FALSE(near_surface(fuse(make_views(3, {}, scene_options(), 0.15))).empty());
}

// Blocks have 8 voxels a side: distances are kept up to two of them from the surface, and the ones between count too.
TEST(TsdfVolume, NoBlockWithinTheTruncationIsMissing) {
  DenseOptions options = scene_options();
  options.truncation = 20 * options.voxel;
  const Views v = make_views(2, {}, options);
  const TsdfVolume volume = fuse(v, options);
  const DepthView& view = v.views[0];
  const int x = view.depth.width() / 2 & ~1, y = view.depth.height() / 2 & ~1;  // of those that blocks are asked for
  const double z = static_cast<double>(view.metres(x, y)), block = options.voxel * VoxelBlock::kSide;
  ASSERT_GT(z, 0);
  int looked = 0;
  for (double along = -options.truncation; along <= options.truncation; along += options.voxel, ++looked) {
    const Eigen::Vector3d p = scene_pose(0) * ((z + along) * v.camera.ray(x, y)) / block;
    const auto side = [](double d) { return static_cast<int32_t>(std::floor(d)); };
    EXPECT_GE(volume.find({side(p.x()), side(p.y()), side(p.z())}), 0) << along;
  }
  EXPECT_GE(looked, 40);
}

TEST(TsdfVolume, SurfacesLieWhereTheyAre) {
  const DenseScene scene;
  const auto points = near_surface(fuse(make_views(6, {})));
  ASSERT_GT(points.size(), 5000u);
  std::vector<double> errors;
  for (const auto& p : points) errors.push_back(scene.distance(p));
  std::sort(errors.begin(), errors.end());
  // Voxels may be half a side off by choice.
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 99 / 100], 0.04);
}

TEST(TsdfVolume, OneViewAloneIsNotBelieved) {
  EXPECT_TRUE(near_surface(fuse(make_views(1, {}))).empty());
}

TEST(TsdfVolume, APersonWhoSlippedInIsCarvedOutByViewsBeforeAndAfter) {
  const size_t uncarved = count_on_person(fuse(make_views(2, {0, 1})));
  EXPECT_GT(uncarved, 200u);
  // What is left was in no other view.
  for (const int first : {0, 4, 8}) EXPECT_LT(8 * count_on_person(fuse(make_views(10, {first, first + 1}))), uncarved);
}

TEST(TsdfVolume, ManyThreadsGiveTheBitsOfOne) {
  const Views v = make_views(5, {2});
  DenseOptions options = scene_options();
  options.threads = 1;
  const TsdfVolume one = fuse(v, options);
  options.threads = 5;
  const TsdfVolume five = fuse(v, options);
  ASSERT_EQ(one.blocks().size(), five.blocks().size());
  for (size_t b = 0; b < one.blocks().size(); ++b) {
    ASSERT_EQ(one.blocks()[b].index, five.blocks()[b].index);
    for (size_t i = 0; i < VoxelBlock::kVoxels; ++i) {
      const Voxel &p = one.blocks()[b].voxels[i], &q = five.blocks()[b].voxels[i];
      ASSERT_TRUE(p.distance == q.distance && p.known == q.known && p.colour == q.colour);
    }
  }
}

TEST(TsdfVolume, BlocksAreSortedAndFound) {
  const TsdfVolume volume = fuse(make_views(3, {}));
  ASSERT_GT(volume.blocks().size(), 100u);
  for (size_t b = 0; b < volume.blocks().size(); ++b) {
    if (b > 0) {
      ASSERT_LT(volume.blocks()[b - 1].index, volume.blocks()[b].index);
    }
    ASSERT_EQ(volume.find(volume.blocks()[b].index), static_cast<int>(b));
  }
  EXPECT_EQ(volume.find({1000, 0, 0}), -1);
}

}  // namespace
}  // namespace dkb
