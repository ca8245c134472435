// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "dkb/geometry/camera.h"

namespace dkb {

// Camera file: a YAML map of fx, fy, cx, cy [px], width, height [px], depth_factor [units per metre], all required; k1,
// k2, p1, p2, k3 (default 0), fps [1/s], readout [s], depth_min, depth_max [m] optional. Throws InputError with
// file:line: unknown (misspelt), missing, repeated or ill-typed key, value out of range, not YAML.
CameraModel read_camera_file(const std::filesystem::path& path);
CameraModel parse_camera(const std::string& text, const std::string& name);

// The same as text, every key with its unit.
std::string camera_to_yaml(const CameraModel& camera);

struct CameraChoice {
  CameraModel camera;
  std::string origin;  // for people: `fr1 (from the folder's name)`, `data/camera.yaml`
};

// `option` (the value of --camera: a built-in name or a file) if not empty; else camera.yaml in the dataset's folder;
// else what the folder's name says (freiburg1 or fr1, freiburg2, freiburg3, bonn, as a word). Throws InputError.
CameraChoice choose_camera(const std::string& option, const std::filesystem::path& dataset);

}  // namespace dkb
