// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "dkb/map/map.h"

namespace dkb {

inline constexpr size_t kNormalNeighbours = 5;

// How the cross products of a point's neighbours are summed (DKB eq. 28). Their signs depend on the order of the
// neighbours, so that the plain sum cancels largely.
enum class NormalSum {
  oriented,  // each product is first turned toward the camera that first saw the point
  plain,     // as printed, in order of distance; the sum is turned once toward that camera
};

// The `kNormalNeighbours` points of `cloud` nearest to each point of `of` (indices into `cloud`), itself left out, by
// increasing distance (DKB eq. 26), ties by index; fewer when the cloud has fewer. By a k-d tree.
std::vector<std::vector<int>> nearest_neighbours(const std::vector<Eigen::Vector3d>& cloud, std::span<const int> of);

// DKB eqs. 27-30: unit normal of the surface at `point` from its neighbours by increasing distance; all in one frame
// [m]. Nothing when there are fewer than five, or when they lie on a line with the point: |S| < 1e-3 sum |V_k||V_t|.
std::optional<Eigen::Vector3d> surface_normal(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> neighbours,
                                              const Eigen::Vector3d& first_camera_centre, NormalSum sum);

// Normals in the world of the points `of`, by the map points in `cloud`. Both are live points by increasing id, and
// `cloud` contains `of`. The camera that first saw a point is the keyframe that it is named after.
std::vector<std::optional<Eigen::Vector3d>> surface_normals(const Map& map, const std::vector<PointId>& of,
                                                            const std::vector<PointId>& cloud, NormalSum sum);

// DKB eq. 31: angle in degrees, 0 ... 180, between a normal and the direction from the point to a camera.
double view_angle_deg(const Eigen::Vector3d& normal, const Eigen::Vector3d& camera_from_point);

// DKB eq. 32: 1 up to 10 degrees, 2 up to 20 and so on in steps of 10; the last level takes all beyond. The paper has 4
// levels; most surfaces are seen at more than 30 degrees, where only more levels tell views apart.
int visibility_level(double angle_deg, int levels);

}  // namespace dkb
