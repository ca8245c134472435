// SPDX-License-Identifier: Apache-2.0
// The node's parameters as a table, so that both wrappers declare, read and document the same ones.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <variant>
#include <vector>

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

}  // namespace dkb_ros
