// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/sensor.h"

#include <algorithm>
#include <cmath>

#include "dkb/simulator/noise.h"

namespace dkb::sim {
namespace {

constexpr double kBaseline = 0.075;  // [m] between projector and camera

uint8_t byte(float v) {
  return static_cast<uint8_t>(std::clamp(v, 0.0F, 255.0F) + 0.5F);
}

float in_units(float z, const CameraModel& camera) {
  const auto factor = static_cast<float>(camera.depth_factor);
  const float units = std::floor(z * factor + 0.5F);
  return units <= 0 || units > 65535 ? 0.0F : static_cast<float>(static_cast<double>(units) / camera.depth_factor);
}

// Whether a window of 2 half_window + 1 pixels around (x, y) sees a depth step.
bool straddles_edge(const Image<float>& inverse_depth, int x, int y, int half_window) {
  const float inverse = inverse_depth(x, y), step = 0.06F * inverse;
  const int left = std::max(x - half_window, 0), right = std::min(x + half_window, inverse_depth.width() - 1);
  for (const int dy : {-half_window, 0, half_window}) {
    const float* row = inverse_depth.row(std::clamp(y + dy, 0, inverse_depth.height() - 1));
    const float most =
        std::max({std::abs(row[left] - inverse), std::abs(row[x] - inverse), std::abs(row[right] - inverse)});
    if (most > step) return true;
  }
  return false;
}

}  // namespace

ColourImage expose(const std::vector<uint64_t>& sum, int width, int height, const Exposure& exposure, uint64_t seed) {
  ColourImage out(width, height);
  // Noise common to the channels and of each channel, so that 0.299 r + 0.587 g + 0.114 b has the wanted spread.
  const double grey_noise = exposure.grey_noise;
  const auto all_own = static_cast<float>(0.8 * grey_noise);
  const auto all_common = static_cast<float>(
      std::sqrt(std::max(0.0, 1 - 0.64 * (0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114))) * grey_noise);
  const float cx = static_cast<float>(width - 1) / 2, cy = static_cast<float>(height - 1) / 2, r2 = cx * cx + cy * cy;
  for (int y = 0; y < height; ++y) {
    const uint64_t* row = sum.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
    Rgb* target = out.row(y);
    const float dy = static_cast<float>(y) - cy;
    const float light = exposure.row_gain.empty() ? 1.0F : exposure.row_gain[static_cast<size_t>(y)];
    const float photons = static_cast<float>(exposure.photon_noise) * std::max(1.0F, light);
    const float own = all_own * std::max(1.0F, light), common = all_common * std::max(1.0F, light);
    for (int x = 0; x < width; ++x) {
      const float dx = static_cast<float>(x) - cx;
      const float gain = (1.0F - 0.16F * (dx * dx + dy * dy) / r2) * (1.0F / 256.0F) * light;
      const uint64_t h = hash64(seed ^ (static_cast<uint64_t>(y) << 32 | static_cast<uint64_t>(x)));
      const uint64_t g = hash64(h);
      const float n = common * normal_from_bits(h);
      // Two independent normals of the second hash's halves: sums of two uniforms are near enough for the channels.
      const auto pair = [&](int shift) {
        return own *
               (static_cast<float>((g >> shift) & 0x3FF) + static_cast<float>((g >> (shift + 10)) & 0x3FF) - 1023.0F) *
               (2.4494897F / 1024.0F);
      };
      const uint64_t c = row[x];
      const float red = static_cast<float>(c & 0xFFFF) * gain, blue = static_cast<float>((c >> 16) & 0xFFFF) * gain,
                  green = static_cast<float>((c >> 32) & 0xFFFF) * gain;
      target[x].r = byte(red + n + pair(0));
      target[x].b = byte(blue + n + pair(20));
      target[x].g = byte(green + n + pair(40));
      if (photons <= 0) continue;
      const auto counted = [&](float level, uint64_t channel) {
        return std::sqrt(photons * level) * normal_from_bits(hash64(g ^ channel));
      };
      target[x].r = byte(red + n + pair(0) + counted(red, 1));
      target[x].b = byte(blue + n + pair(20) + counted(blue, 2));
      target[x].g = byte(green + n + pair(40) + counted(green, 3));
    }
  }
  return out;
}

DepthImage round_depth(const Image<float>& inverse_depth, const CameraModel& camera) {
  DepthImage out(inverse_depth.width(), inverse_depth.height());
  for (int y = 0; y < out.height(); ++y)
    for (int x = 0; x < out.width(); ++x) {
      const float i = inverse_depth(x, y), z = i > 0 ? 1 / i : 0;
      if (z >= static_cast<float>(camera.depth_min) && z <= static_cast<float>(camera.depth_max))
        out(x, y) = in_units(z, camera);
    }
  return out;
}

void look_through(const Image<float>& pane_inverse_depth, const Image<float>& pane_cosine,
                  const Image<float>& inverse_depth, Image<float>* grey) {
  for (size_t i = 0; i < grey->size(); ++i) {
    if (pane_inverse_depth.data()[i] <= inverse_depth.data()[i]) continue;
    const float c = pane_cosine.data()[i];
    grey->data()[i] *= c > 0.995F ? 0.0F : 0.6F * std::clamp((c - 0.3F) / 0.4F, 0.0F, 1.0F);
  }
}

DepthImage sense_depth(const Image<float>& inverse_depth, const Image<float>& grey, const Image<float>& cosine,
                       const CameraModel& camera, uint64_t seed) {
  const int width = inverse_depth.width(), height = inverse_depth.height();
  DepthImage out(width, height);
  const auto fb = static_cast<float>(camera.fx * kBaseline);  // disparity [px] = fb / z
  const auto z_min = static_cast<float>(camera.depth_min), z_max = static_cast<float>(camera.depth_max);
  std::vector<float> shadow(static_cast<size_t>(width));
  std::vector<int> source(static_cast<size_t>(width));
  for (int y = 0; y < height; ++y) {
    const auto fy = static_cast<float>(y);
    LatticeRow wander(fy * 0.35F, hash64(seed, 11)), patches(fy * 0.12F, hash64(seed, 12));
    LatticeRow grain(fy * 0.4F, hash64(seed, 13)), shared_noise(fy * 0.31F + 3.3F, hash64(seed, 14));
    // The sensor correlates windows: outlines wander by about a pixel.
    for (int x = 0; x < width; ++x) {
      const float n = wander.at(static_cast<float>(x) * 0.35F);
      source[static_cast<size_t>(x)] = std::clamp(x + static_cast<int>(std::floor(n * 1.6F + 0.5F)), 0, width - 1);
    }
    // A point is lit when no point further right hides it from the projector, which stands to the right: along the row
    // its column in the projector's image must fall.
    float lowest = 1e9F;
    for (int x = width - 1; x >= 0; --x) {
      const float i = inverse_depth(source[static_cast<size_t>(x)], y), column = static_cast<float>(x) - fb * i;
      shadow[static_cast<size_t>(x)] = column - lowest;
      lowest = std::min(lowest, column);
    }
    for (int x = 0; x < width; ++x) {
      const int sx = source[static_cast<size_t>(x)];
      const float inverse = inverse_depth(sx, y);
      if (inverse <= 0) continue;
      const float z = 1 / inverse;
      if (z < z_min || z > z_max) continue;
      const uint64_t h = hash64(seed ^ (static_cast<uint64_t>(y) << 32 | static_cast<uint64_t>(x)));
      const auto fx = static_cast<float>(x);
      const float patch = patches.at(fx * 0.12F);
      const float rough = 0.6F * patch + 0.4F * grain.at(fx * 0.4F);
      if (shadow[static_cast<size_t>(x)] > 1.0F + 0.6F * patch) continue;
      if (cosine(sx, y) < 0.19F + 0.06F * rough) continue;                                          // slanted
      if (grey(sx, y) * (0.4F + 0.6F * cosine(sx, y)) < 23.0F + 9.0F * rough + 1.5F * z) continue;  // dark
      if ((h & 1023) < 2) continue;                                                                 // single drop-outs
      // Windows that straddle an edge find no match.
      if (rough > -0.25F && straddles_edge(inverse_depth, sx, y, rough > 0.1F ? 2 : 1)) continue;
      // Two fifths of the noise's variance are shared by neighbours, as windows overlap: 1.96 times lattice noise has a
      // spread of 0.84, so the sum of both has 0.92 sigma. It stays so: all simulated figures are of it.
      const float sigma = 0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F);
      const float shared = 1.96F * shared_noise.at(fx * 0.31F + 7.7F);
      const float noise = 0.70710678F * (normal_from_bits(hash64(h)) + shared) * sigma;
      const float disparity = fb * inverse - noise * fb * inverse * inverse;
      const float stepped = std::floor(disparity * 8.0F + 0.5F) / 8.0F;
      if (stepped <= 0) continue;
      const float measured = fb / stepped;
      if (measured >= z_min && measured <= z_max) out(x, y) = in_units(measured, camera);
    }
  }
  return out;
}

}  // namespace dkb::sim
