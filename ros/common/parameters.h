// SPDX-License-Identifier: Apache-2.0
// The node's parameters, checked.
#pragma once

#include <dkb_slam/slam.h>

#include <map>
#include <optional>

#include "parameter_descriptions.h"
#include "types.h"

namespace dkb_ros {

enum class PriorKind { none, odom, imu, automatic };

struct Parameters {
  std::string map_frame = "map", odom_frame = "odom", base_frame = "base_link", camera_frame;
  std::optional<Rigid3> base_from_cam;  // nothing = by TF
  bool publish_map_tf = true, publish_odom_tf = true;

  std::string camera;
  bool rectified = false;
  double depth_factor = 1000;
  double sync_tolerance = 0.02;  // [s]
  int queue_size = 10;

  PriorKind prior = PriorKind::automatic;
  double prior_drift = 0.01;

  dkb::DetectorChoice detector;
  std::string load_map;
  bool localize_only = false;
  double map_period = 1, grid_period = 0;  // [s] 0 = never
  double path_step = 0.05;                 // [m]
  int viewer_port = -1;                    // of the live page; 0 = any, -1 = none
  std::string viewer_host = "127.0.0.1";

  dkb::Options options;  // the settings

  // Throws dkb::InputError naming the parameter. Names that are not given keep their defaults.
  static Parameters from_values(const std::map<std::string, ParameterValue>& values);
};

}  // namespace dkb_ros
