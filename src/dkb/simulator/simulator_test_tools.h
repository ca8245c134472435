// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <numeric>
#include <string>

#include "dkb/simulator/simulator.h"

namespace dkb::test {

inline double mean_grey(const GreyImage& image) {
  return std::accumulate(image.data(), image.data() + image.size(), 0.0) / static_cast<double>(image.size());
}

// Options of a sequence in small images.
inline SimulatorOptions small_images(const std::string& scene, int frames, int width, int height) {
  SimulatorOptions o;
  o.scene = scene;
  o.frames = frames;
  o.width = width;
  o.height = height;
  return o;
}

}  // namespace dkb::test
