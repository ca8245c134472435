// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/image/image.h"

namespace dkb::sim {

struct Exposure {
  double grey_noise = 0;        // [grey levels] standard deviation of the electronics' noise in the grey image
  std::vector<float> row_gain;  // brightness of each row; above 1 the noise is amplified as well. Empty: 1
  double photon_noise = 0;      // [grey levels] variance of each channel per level of light
};

// Colour image from sums as Rasteriser::add_colour leaves them after eight calls: vignetting, then noise, then
// rounding; what is too bright is cut.
ColourImage expose(const std::vector<uint64_t>& sum, int width, int height, const Exposure& exposure, uint64_t seed);

// Depth as a structured-light sensor gives it: about Gaussian noise of 0.92 (0.0012 + 0.0019 (z - 0.4)^2) m, two fifths
// of its variance shared by neighbours, disparity in steps of 1/8 px (baseline 7.5 cm), ragged edges, holes in the
// projector's shadow, at edges, on dark and on slanted surfaces, nothing outside depth_min ... depth_max. Values are
// multiples of 1 / depth_factor.
DepthImage sense_depth(const Image<float>& inverse_depth, const Image<float>& grey, const Image<float>& cosine,
                       const CameraModel& camera, uint64_t seed);

// Takes from `grey` (of what stands behind) what panes of glass take from the projector's light on its way there and
// back: a good deal where it passes straight, all of it where it passes at a slant or is thrown back to the camera.
void look_through(const Image<float>& pane_inverse_depth, const Image<float>& pane_cosine,
                  const Image<float>& inverse_depth, Image<float>* grey);

// Only rounded to the file's units and cut to the range.
DepthImage round_depth(const Image<float>& inverse_depth, const CameraModel& camera);

}  // namespace dkb::sim
