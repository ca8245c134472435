// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "dkb_slam/map.h"

namespace dkb {

// The same surface with `max_vertices` at most: those in a cell of space become one, in cells as large as it takes.
SurfaceMesh coarser(const SurfaceMesh& mesh, size_t max_vertices);

// The messages `surface` and `grid` of a dense map; `root` is that of the map that it is of.
std::string dense_messages(const DenseMap& map, int root);

}  // namespace dkb
