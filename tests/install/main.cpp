// SPDX-License-Identifier: Apache-2.0
#include <dkb/geometry/camera.h>

#include <cstdio>

int main() {
  const dkb::CameraModel camera = dkb::builtin_camera("fr3").value();
  const Eigen::Vector3d point_in_cam = camera.unproject({320.1, 247.6}, 2.0);
  std::printf("%.1f %.1f %.1f\n", point_in_cam.x(), point_in_cam.y(), point_in_cam.z());
  return point_in_cam.isApprox(Eigen::Vector3d(0, 0, 2)) ? 0 : 1;
}
