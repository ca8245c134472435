// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_formats.h"

#include <fmt/format.h>

#include "dkb/util/stamps.h"

namespace dkb {

std::string trajectory_to_kitti(const Trajectory& trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Matrix3d r = pose.world_from_cam.matrix3();
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    for (int row = 0; row < 3; ++row)
      text +=
          fmt::format("{}{:.12g} {:.12g} {:.12g} {:.9f}", row == 0 ? "" : " ", r(row, 0), r(row, 1), r(row, 2), t[row]);
    text += '\n';
  }
  return text;
}

std::string trajectory_to_euroc(const Trajectory& trajectory) {
  std::string text = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n";
  for (const StampedPose& pose : trajectory) {
    const auto exact = parse_stamp_ns(pose.stamp);
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    const Eigen::Quaterniond& q = pose.world_from_cam.rotation;
    const double sign = q.w() < 0 ? -1 : 1;  // a sum with 0.0 turns -0 into 0
    text += fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n",
                        exact ? *exact : ns_from_seconds(pose.timestamp), t.x(), t.y(), t.z(), sign * q.w() + 0.0,
                        sign * q.x() + 0.0, sign * q.y() + 0.0, sign * q.z() + 0.0);
  }
  return text;
}

}  // namespace dkb
