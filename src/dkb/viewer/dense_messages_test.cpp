// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/dense_messages.h"

#include <gtest/gtest.h>

#include <cstring>

namespace dkb {
namespace {

// A square of side 10 m, in n x n vertices.
SurfaceMesh square(int n) {
  SurfaceMesh mesh;
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      mesh.vertices.emplace_back(10.0F * static_cast<float>(x) / static_cast<float>(n), 1.5F,
                                 10.0F * static_cast<float>(y) / static_cast<float>(n));
      mesh.colours.push_back({200, 100, 50});
      if (x == 0 || y == 0) continue;
      const int32_t i = y * n + x;
      mesh.triangles.push_back({i, i - 1, i - n});
      mesh.triangles.push_back({i - 1, i - n - 1, i - n});
    }
  return mesh;
}

double area(const SurfaceMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const auto at = [&](int k) { return mesh.vertices[static_cast<size_t>(t[static_cast<size_t>(k)])]; };
    sum += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
  }
  return sum;
}

TEST(DenseMessages, ACoarserSurfaceCoversTheSame) {
  const SurfaceMesh fine = square(300), coarse = coarser(fine, 2000);
  EXPECT_LE(coarse.vertices.size(), 2000U);
  EXPECT_GE(coarse.vertices.size(), 500U);
  EXPECT_NEAR(area(coarse), area(fine), 0.1 * area(fine));
  EXPECT_EQ(coarse.colours.front(), (Rgb{200, 100, 50}));
  EXPECT_EQ(coarser(fine, 90000).vertices.size(), 90000U);
}

TEST(DenseMessages, HoldSurfaceAndGrid) {
  DenseMap map;
  EXPECT_EQ(dense_messages(map, 0), "");
  map.mesh = square(3);
  map.grid.emplace();
  map.grid->cells = Image<uint8_t>(70, 1000, OccupancyGrid::kFree);
  map.grid->cells(3, 0) = OccupancyGrid::kOccupied;
  const std::string bytes = dense_messages(map, 7);
  // Head 8; 28; 9 vertices of 6, padded to 56, of 4; 8 triangles of 6. Then head 8; 52; runs of 3, 1, 65535 and the
  // rest.
  ASSERT_EQ(bytes.size(), 8U + 28 + 56 + 36 + 48 + 8 + 52 + 4 * 4);
  int32_t root = 0;
  std::memcpy(&root, bytes.data() + 8, 4);
  EXPECT_EQ(root, 7);
  int16_t x = 0;
  std::memcpy(&x, bytes.data() + 8 + 28 + 6, 2);
  EXPECT_EQ(x, 0);  // the middle one of the first row
  std::memcpy(&x, bytes.data() + 8 + 28, 2);
  EXPECT_EQ(x, -3333);
  uint16_t runs[8];
  std::memcpy(runs, bytes.data() + bytes.size() - 16, 16);
  EXPECT_EQ(runs[0], 3);
  EXPECT_EQ(runs[1], OccupancyGrid::kFree);
  EXPECT_EQ(runs[2], 1);
  EXPECT_EQ(runs[3], OccupancyGrid::kOccupied);
  EXPECT_EQ(runs[4] + runs[6], 70 * 1000 - 4);
}

}  // namespace
}  // namespace dkb
