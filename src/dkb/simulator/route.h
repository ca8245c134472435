// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/simulator/camera_path.h"

namespace dkb::sim {

// A corner of a route, rounded with `radius` [m].
struct RouteCorner {
  Eigen::Vector2d place;
  double radius = 1;
};

// A robot's way over the floor: straight lines and arcs, looking ahead.
class Route {
 public:
  explicit Route(const std::vector<RouteCorner>& corners);

  struct Place {
    Eigen::Vector2d position;
    double heading = 0;    // [rad] from +x towards +y, without jumps by turns
    double curvature = 0;  // [1/m]
  };
  double length() const { return pieces_.back().start + pieces_.back().length; }
  Place at(double metres) const;

  // Its poses over time: from rest to rest in `duration` seconds, turning by at most `turn_rate` [rad/s], speeding up
  // and slowing down by at most `acceleration` [m/s^2], otherwise as fast as that takes.
  struct Drive {
    double turn_rate = 1.0, acceleration = 0.6;
    double height = 1.1, pitch = -0.1;  // [m], [rad] of the camera
  };
  std::vector<TimedPose> drive(double duration, const Drive& how) const;

 private:
  struct Piece {
    double start, length;
    Eigen::Vector2d from;
    double heading, curvature;
  };
  std::vector<Piece> pieces_;
};

}  // namespace dkb::sim
