// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_surface.h"

#include <cmath>

namespace dkb {
namespace {

constexpr int kMinThere = 6;           // points that show that somebody stands, or has left
constexpr double kNearestPoint = 0.1;  // [m]
constexpr double kSway = 0.05;         // [m] that who stands still moves by

// Pixel of a point before the camera.
bool pixel_of(const CameraModel& camera, const Eigen::Vector3d& p, Eigen::Vector2i* pixel) {
  if (p.z() < kNearestPoint) return false;
  const auto at = image_pixel(camera, p);
  if (!at || !(at->x() > -1e4 && at->y() > -1e4 && at->x() < 1e5 && at->y() < 1e5)) return false;
  *pixel = {static_cast<int>(std::lround(at->x())), static_cast<int>(std::lround(at->y()))};
  return true;
}

}  // namespace

MoverSurface::Points MoverSurface::compare(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                                           const Rigid3& world_from_cam) const {
  const Rigid3 cam_from_world = world_from_cam.inverse();
  Points points;
  Eigen::Vector2i at;
  for (const Eigen::Vector3d& point : points_in_world) {
    const Eigen::Vector3d p = cam_from_world * point;
    if (!pixel_of(camera, p, &at) || !depth.contains(at.x(), at.y())) continue;
    const auto measured = static_cast<double>(depth(at.x(), at.y()));
    if (!(measured > 0)) continue;
    const double tolerance = kSway + noise.surface_tolerance(p.z());
    points.there += std::abs(measured - p.z()) <= tolerance;
    points.beyond += measured > p.z() + tolerance;
    points.nearer += measured < p.z() - tolerance;
  }
  return points;
}

bool MoverSurface::stands(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                          const Rigid3& world_from_cam) const {
  const Points p = compare(depth, camera, noise, world_from_cam);
  return p.there >= kMinThere && p.there >= p.beyond;
}

bool MoverSurface::has_left(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                            const Rigid3& world_from_cam) const {
  const Points p = compare(depth, camera, noise, world_from_cam);
  const int elsewhere = p.beyond + p.nearer;
  return p.there + elsewhere >= kMinThere && p.there < elsewhere;
}

void MoverSurface::move(const Rigid3& new_from_old) {
  position_in_world = new_from_old * position_in_world;
  for (Eigen::Vector3d& p : points_in_world) p = new_from_old * p;
}

Box MoverSurface::box_in(const CameraModel& camera, const Rigid3& world_from_cam) const {
  const Rigid3 cam_from_world = world_from_cam.inverse();
  Eigen::Vector2i low(camera.width, camera.height), high(0, 0), at;
  for (const Eigen::Vector3d& point : points_in_world) {
    if (!pixel_of(camera, cam_from_world * point, &at)) continue;
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const Eigen::Vector2f corner = low.cast<float>(), size = (high - low).cwiseMax(0).cast<float>();
  return clip({corner.x(), corner.y(), size.x(), size.y()}, camera.width, camera.height);
}

}  // namespace dkb
