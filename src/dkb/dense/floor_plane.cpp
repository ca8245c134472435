// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/floor_plane.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "dkb/geometry/decompositions.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr double kMinUp = 0.819;      // cos 35 degrees, of a normal to the guess
constexpr double kParallel = 0.966;   // cos 15 degrees, of normals in one plane
constexpr double kThickness = 0.03;   // [m] half of it
constexpr double kMinArea = 0.25;     // [m^2]
constexpr double kLowerShare = 0.25;  // of the largest plane's area
constexpr int kHypotheses = 200;
constexpr size_t kSampleOfTriangles = 20000;  // enough to count areas by

struct Facet {
  Eigen::Vector3d centre, normal;
  double area;
};

std::vector<Facet> upward_facets(const SurfaceMesh& mesh, const Eigen::Vector3d& up) {
  std::vector<Facet> facets;
  for (const auto& t : mesh.triangles) {
    const auto at = [&](size_t i) { return mesh.vertices[static_cast<size_t>(t[i])].cast<double>().eval(); };
    const Eigen::Vector3d a = at(0), b = at(1), c = at(2), normal = (b - a).cross(c - a);
    const double length = normal.norm();
    if (length < 1e-12 || normal.dot(up) < kMinUp * length) continue;
    facets.push_back({(a + b + c) / 3, normal / length, 0.5 * length});
  }
  return facets;
}

double area_in(const std::vector<Facet>& facets, size_t stride, const Eigen::Vector3d& up, double height) {
  double area = 0;
  for (size_t i = 0; i < facets.size(); i += stride)
    if (std::abs(up.dot(facets[i].centre) - height) < kThickness && facets[i].normal.dot(up) > kParallel)
      area += facets[i].area;
  return area * static_cast<double>(stride);
}

// Least-squares plane through the facets near a plane.
FloorPlane refined(const std::vector<Facet>& facets, FloorPlane plane) {
  for (int round = 0; round < 3; ++round) {
    double weight = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    for (const Facet& f : facets) {
      if (std::abs(plane.up.dot(f.centre) - plane.height) > kThickness || f.normal.dot(plane.up) < kParallel) continue;
      weight += f.area;
      mean += f.area * f.centre;
      squares += f.area * f.centre * f.centre.transpose();
    }
    if (weight <= 0) break;
    mean /= weight;
    Eigen::Vector3d normal = spectrum(Eigen::Matrix3d(squares / weight - mean * mean.transpose())).vectors.col(0);
    if (normal.dot(plane.up) < 0) normal = -normal;
    plane = {normal, normal.dot(mean), weight};
  }
  return plane;
}

}  // namespace

std::optional<FloorPlane> find_floor(const SurfaceMesh& mesh, const Eigen::Vector3d& up_guess, uint64_t seed) {
  const std::vector<Facet> facets = upward_facets(mesh, up_guess.normalized());
  if (facets.size() < 3) return std::nullopt;
  const size_t stride = 1 + facets.size() / kSampleOfTriangles;
  Random random(seed);
  FloorPlane best;
  const auto any = [&]() -> const Eigen::Vector3d& {
    return facets[random.below(static_cast<uint32_t>(facets.size()))].centre;
  };
  for (int i = 0; i < kHypotheses; ++i) {
    const Eigen::Vector3d a = any(), b = any(), c = any();
    Eigen::Vector3d normal = (b - a).cross(c - a);
    const double length = normal.norm();
    if (length < 1e-3) continue;
    normal *= (normal.dot(up_guess) < 0 ? -1 : 1) / length;
    if (normal.dot(up_guess.normalized()) < kMinUp) continue;
    const double area = area_in(facets, stride, normal, normal.dot(a));
    if (area > best.area) best = {normal, normal.dot(a), area};
  }
  if (best.area < kMinArea) return std::nullopt;
  best = refined(facets, best);

  // Lower ones, by steps of half a thickness from the lowest facet up.
  double lowest = best.height;
  for (const Facet& f : facets) lowest = std::min(lowest, best.up.dot(f.centre));
  const double enough = std::max(kMinArea, kLowerShare * best.area);
  for (double height = lowest; height < best.height - 2 * kThickness; height += kThickness)
    if (area_in(facets, stride, best.up, height) >= enough) return refined(facets, {best.up, height, 0});
  return best;
}

Rigid3 floor_from_world(const FloorPlane& floor, const Eigen::Vector3d& forward) {
  Eigen::Vector3d x = forward - floor.up * floor.up.dot(forward);
  if (x.norm() < 1e-6) x = floor.up.unitOrthogonal();
  x.normalize();
  Eigen::Matrix3d rotation;
  rotation.row(0) = x.transpose();
  rotation.row(1) = floor.up.cross(x).transpose();
  rotation.row(2) = floor.up.transpose();
  return {Eigen::Quaterniond(rotation).normalized(), Eigen::Vector3d(0, 0, -floor.height)};
}

}  // namespace dkb
