// SPDX-License-Identifier: Apache-2.0
// The node's parameters as a table, so that both wrappers declare, read and document the same ones.
#pragma once

#include <limits>
#include <variant>

#include "types.h"

namespace dkb_ros {

using ParameterValue = std::variant<bool, int64_t, double, std::string, std::vector<double>>;

struct ParameterDescription {
  std::string name;        // of settings the key in config.yaml, with dots
  ParameterValue initial;  // its type is the parameter's
  std::string meaning;     // with the unit in front: "[m] ..."
  double min = -std::numeric_limits<double>::infinity(), max = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices = {};  // of texts that take nothing else
};

// Those of the node, then every setting of the library, which the node reads once, when it starts.
const std::vector<ParameterDescription>& parameter_descriptions();
// The same as the Markdown table of docs/ros.md.
std::string parameter_table();

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
  double prior_drift = 0.02;

  dkb::DetectorChoice detector;
  std::string load_map;
  bool localize_only = false;
  double map_period = 1, grid_period = 0;  // [s] 0 = never
  double path_step = 0.05;                 // [m]

  dkb::Options options;  // the settings

  // Throws dkb::InputError naming the parameter. Names that are not given keep their defaults.
  static Parameters from_values(const std::map<std::string, ParameterValue>& values);
};

}  // namespace dkb_ros
