// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_formats.h"

#include <fmt/format.h>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/fixed_text.h"
#include "dkb/util/stamps.h"

namespace dkb {

std::string trajectory_to_kitti(const Trajectory& trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Matrix3d r = (pose.world_from_cam.matrix3().array() + 0.0).matrix();  // turns -0 into 0
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    for (int row = 0; row < 3; ++row)
      text += fmt::format("{}{:.12g} {:.12g} {:.12g} {}", row == 0 ? "" : " ", r(row, 0), r(row, 1), r(row, 2),
                          fixed_text(t[row], 9));
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
    const double sign = q.w() < 0 ? -1 : 1;
    text += std::to_string(exact ? *exact : ns_from_seconds(pose.timestamp));
    for (const double value : {t.x(), t.y(), t.z(), sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z()})
      text += ',' + fixed_text(value, 9);
    text += '\n';
  }
  return text;
}

std::string trajectory_to_text(const Trajectory& trajectory, TrajectoryFormat format) {
  switch (format) {
    case TrajectoryFormat::kitti:
      return trajectory_to_kitti(trajectory);
    case TrajectoryFormat::euroc:
      return trajectory_to_euroc(trajectory);
    case TrajectoryFormat::tum:
      break;
  }
  return trajectory_to_text(trajectory);
}

TrajectoryFormat trajectory_format_named(const std::string& name, const std::string& where) {
  if (name == "tum") return TrajectoryFormat::tum;
  if (name == "kitti") return TrajectoryFormat::kitti;
  if (name == "euroc") return TrajectoryFormat::euroc;
  throw InputError(where + ": there is no \"" + name + "\"; give one of tum, kitti, euroc");
}

void save_trajectory(const std::filesystem::path& path, const std::vector<TrajectoryFrame>& trajectory, int map,
                     TrajectoryFormat format, const std::vector<std::string>& stamps) {
  std::vector<TrajectoryFrame> of_map;
  for (const TrajectoryFrame& f : trajectory) {
    if (f.map != map) continue;
    if (!stamps.empty() && f.frame >= static_cast<int>(stamps.size()))
      throw InputError(fmt::format("stamps: frame {} has none; there are {}", f.frame, stamps.size()));
    of_map.push_back(f);
    of_map.back().map = 0;
  }
  write_file_atomically(path, trajectory_to_text(trajectories_by_map(of_map, stamps).front(), format));
}

}  // namespace dkb
