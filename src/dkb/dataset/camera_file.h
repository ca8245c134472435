// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "dkb/geometry/camera.h"

namespace dkb {

// The text of a camera file (Camera::load), ours or a calibration (calibration_file.h), which `name` stands for in
// messages.
Camera parse_camera(const std::string& text, const std::string& name);

// A camera without limits of depth: what is read by it loses nothing.
Camera without_limits(Camera camera);

struct CameraChoice {
  CameraModel camera;
  std::string origin;      // for people: `fr1 (from the folder's name)`, `data/camera.yaml`
  std::string doubt = {};  // why it may be another one; empty = no reason
};

// What is strange about a camera's numbers, which `name` opens; empty when nothing is.
std::string doubt_of(const Camera& camera, const std::string& name);

// `option` (the value of --camera: a built-in name or a file) if not empty; else camera.yaml in the dataset's folder;
// else what the folder's name says (freiburg1 or fr1, freiburg2, freiburg3, bonn, as a word). Throws InputError.
CameraChoice choose_camera(const std::string& option, const std::filesystem::path& dataset);

}  // namespace dkb
