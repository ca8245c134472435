// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dkb/dense/tsdf_volume.h"
#include "dkb/image/image.h"

namespace dkb {

// Triangles in the world [m]; seen from outside, their corners run counter-clockwise.
struct SurfaceMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Rgb> colours;  // per vertex
  std::vector<std::array<int32_t, 3>> triangles;
};

// The surface where the distance is zero, by surface nets (Gibson 1998, "Constrained elastic surface nets", without
// relaxation): one vertex in every cell of eight known voxels that the surface cuts, at the mean of the cuts; a quad
// for every cut edge. So a vertex stands for an occupied voxel. Deterministic: by increasing block.
SurfaceMesh extract_surface(const TsdfVolume& volume);

// Without connected parts whose area [m^2] is below `min_area`, and without vertices of no triangle.
SurfaceMesh without_small_parts(const SurfaceMesh& mesh, double min_area);

// Stanford PLY, binary little-endian: x y z float, red green blue uchar; faces of three.
std::string mesh_ply(const SurfaceMesh& mesh);

}  // namespace dkb
