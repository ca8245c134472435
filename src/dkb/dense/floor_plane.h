// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "dkb/dense/surface_mesh.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

// The floor of a mesh: points with up . p = height.
struct FloorPlane {
  Eigen::Vector3d up;  // unit normal
  double height = 0;   // [m]
  double area = 0;     // [m^2] of the mesh that lies in it
};

// The lowest of the large planes that look up, by RANSAC over triangles: a candidate's normal is within 35 degrees of
// `up_guess`, and a lower parallel plane wins from a quarter of the largest one's area on. Nothing when no such plane
// has 0.25 m^2. With no floor in view that may be a table. Deterministic by `seed`.
std::optional<FloorPlane> find_floor(const SurfaceMesh& mesh, const Eigen::Vector3d& up_guess, uint64_t seed);

// World to a frame whose z = 0 is the floor: z up, x along `forward` on the floor, origin below the world's.
Rigid3 floor_from_world(const FloorPlane& floor, const Eigen::Vector3d& forward);

}  // namespace dkb
