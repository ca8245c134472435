// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb/devices/device_module.h"
#include "dkb_slam/geometry.h"

namespace dkb {

// What a device tells of its camera, as ours.
struct ToldCamera {
  Camera camera;       // fx is 0 where its lens cannot be taken
  std::string reason;  // then, for people: `name: reason; give --camera FILE`
};

ToldCamera told_camera(const DkbDeviceCamera& told);

// In: Brown-Conrady coefficients that take the distortion away (x = xd (1 + k1 r2 + k2 r4 + k3 r6) + ..., r of the
// image point), as RealSense cameras tell them. Out: those of Camera, which distort, fitted over the image by least
// squares. Returns the largest error [px] on a grid of the image.
double fit_inverse_lens(Camera* camera);

}  // namespace dkb
