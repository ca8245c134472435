// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/geometry/rigid3.h"

namespace dkb {

// The frame that a robot steers by: world_from_odom takes every jump of the map, so that odom_from_cam makes none.
// Nobody knows how the camera moved while it was lost: odometry goes on from where it was then.
class OdometryFrame {
 public:
  explicit OdometryFrame(const Rigid3& base_from_cam) : odom_from_cam_(base_from_cam) {}

  void move_world(const Rigid3& new_world_from_old) { world_from_odom_ = new_world_from_old * world_from_odom_; }
  void lost() { continuous_ = false; }
  // A pose of the camera. `jumps`: it does not follow from the one before.
  void update(const Rigid3& world_from_cam, bool jumps) {
    if (jumps || !continuous_) world_from_odom_ = world_from_cam * odom_from_cam_.inverse();
    continuous_ = true;
    odom_from_cam_ = world_from_odom_.inverse() * world_from_cam;
  }

  const Rigid3& world_from_odom() const { return world_from_odom_; }
  const Rigid3& odom_from_cam() const { return odom_from_cam_; }

 private:
  Rigid3 world_from_odom_, odom_from_cam_;
  bool continuous_ = true;
};

}  // namespace dkb
