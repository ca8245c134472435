// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/dense/tsdf_volume.h"
#include "dkb_slam/map.h"

namespace dkb {

// The surface where the distance is zero, by surface nets (Gibson 1998, "Constrained elastic surface nets", without
// relaxation): one vertex in every cell of eight known voxels that the surface cuts, at the mean of the cuts; a quad
// for every cut edge. So a vertex stands for an occupied voxel. Deterministic: by increasing block.
SurfaceMesh extract_surface(const TsdfVolume& volume);

// Without connected parts whose area [m^2] is below `min_area`, and without vertices of no triangle.
SurfaceMesh without_small_parts(const SurfaceMesh& mesh, double min_area);

}  // namespace dkb
