// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "dkb/geometry/camera.h"

namespace dkb {

// The cameras that published layouts keep in files of their own. `name` opens the messages; all throw InputError.

// ScanNet's intrinsic_color.txt: a matrix of 4 x 4 numbers (3 x 3 serves too), for images of the given size.
CameraModel parse_intrinsic_matrix(std::string_view text, const std::string& name, int width, int height);

// Replica's cam_params.json: {"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}.
CameraModel parse_replica_camera(std::string_view text, const std::string& name);

// Open3D's pinhole camera: {"width", "height", "intrinsic_matrix": nine numbers by columns}; depth in millimetres.
CameraModel parse_open3d_camera(std::string_view text, const std::string& name);

// OpenLORIS' sensors.yaml: width, height, fps and intrinsics (fx cx fy cy) of d400_color_optical_frame; depth in
// millimetres.
CameraModel parse_openloris_camera(std::string_view text, const std::string& name);

// The camera of the same pictures at another size. (0, 0) is the centre of a pixel, hence the halves.
CameraModel resized(const CameraModel& camera, int width, int height);

}  // namespace dkb
