// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "dkb/solver/bundle_adjustment.h"
#include "dkb/solver/pose_optimiser.h"
#include "dkb/util/random.h"

namespace dkb {

// [m, rad], whichever is more.
inline double distance(const Rigid3& a, const Rigid3& b) {
  const Rigid3 d = a * b.inverse();
  return std::max(d.translation.norm(), vector_from_rotation(d.rotation).norm());
}

// A camera moves sideways along a wall of points 1.5 to 4.5 m away, wavering as a hand does. For tests and benchmarks.
struct TestWorldOptions {
  int cameras = 12;
  int fixed = 3;  // the first ones
  int points = 400;
  double step = 0.08;         // [m] between cameras
  double pixel_noise = 0.7;   // [px] standard deviation at sigma 1
  double depth_noise = 0.01;  // [m]
  double depth_share = 0.7;   // part of the observations with depth
  double outlier_share = 0.0;
  double visibility = 1.0;    // chance that a camera observes a point in its view
  double pose_error = 0.02;   // [m, rad] standard deviation of the free cameras' start
  double point_error = 0.03;  // [m] of the points' start
  uint64_t seed = 1;
};

struct TestWorld {
  BaProblem problem;                    // with errors
  std::vector<Rigid3> cam_from_world;   // true
  std::vector<Eigen::Vector3d> points;  // true
  std::vector<uint8_t> outlier;         // per observation

  explicit TestWorld(const TestWorldOptions& options) {
    Random random(options.seed);
    const auto noise = [&](double sigma) { return sigma * random.normal(); };
    const auto vector = [&](double sigma) {
      Eigen::Vector3d v;
      for (int k = 0; k < 3; ++k) v[k] = noise(sigma);
      return v;
    };
    for (int c = 0; c < options.cameras; ++c) {
      const Eigen::Vector3d centre = Eigen::Vector3d(options.step * c, 0, 0) + vector(0.05);
      const Eigen::Quaterniond world_from_cam = rotation_from_vector(vector(0.05));
      cam_from_world.push_back(Rigid3(world_from_cam, centre).inverse());
    }
    const double length = options.step * options.cameras;
    for (int p = 0; p < options.points; ++p) {
      points.push_back({random.uniform(-1.5, length + 1.5), random.uniform(-1.2, 1.2), random.uniform(1.5, 4.5)});
    }
    const CameraModel& camera = problem.camera;
    for (int c = 0; c < options.cameras; ++c) {
      for (int p = 0; p < options.points; ++p) {
        const Eigen::Vector3d in_cam = cam_from_world[c] * points[p];
        if (in_cam.z() < 0.3) continue;
        const Eigen::Vector2d pixel = camera.project(in_cam);
        if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera.width || pixel.y() >= camera.height) continue;
        if (random.uniform() >= options.visibility) continue;
        BaObservation o;
        o.camera = c;
        o.point = p;
        const double sigma = std::pow(1.2, random.below(8));
        o.inv_sigma = 1.0 / sigma;
        o.u = pixel.x() + noise(options.pixel_noise * sigma);
        o.v = pixel.y() + noise(options.pixel_noise * sigma);
        if (random.uniform() < options.depth_share) {
          o.depth = std::max(0.1, in_cam.z() + noise(options.depth_noise));
          o.inv_depth_sigma = 1.0 / options.depth_noise;
        }
        const bool wrong = random.uniform() < options.outlier_share;
        if (wrong) {
          o.u += random.uniform(15, 60);
          o.v -= random.uniform(15, 60);
        }
        outlier.push_back(wrong);
        problem.observations.push_back(o);
      }
    }
    problem.cam_from_world = cam_from_world;
    problem.points = points;
    for (int c = 0; c < options.cameras; ++c) {
      problem.fixed.push_back(c < options.fixed);
      if (c < options.fixed) continue;
      Vector6d error;
      error << vector(options.pose_error), vector(options.pose_error);
      problem.cam_from_world[c] = rigid3_from_tangent(error) * problem.cam_from_world[c];
    }
    for (Eigen::Vector3d& point : problem.points) point += vector(options.point_error);
  }

  // What one camera sees, with the true points.
  std::vector<PoseObservation> pose_observations(int camera) const {
    std::vector<PoseObservation> observations;
    for (const BaObservation& o : problem.observations) {
      if (o.camera != camera) continue;
      observations.push_back(
          {points[o.point], {o.u, o.v}, 1.0 / o.inv_sigma, o.depth, o.depth > 0 ? 1.0 / o.inv_depth_sigma : 0.01});
    }
    return observations;
  }
};

}  // namespace dkb
