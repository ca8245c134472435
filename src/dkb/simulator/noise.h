// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "dkb/util/random.h"

namespace dkb::sim {

// Stateless noise: a value is a function of its coordinates and a seed alone, so that any pixel of any frame can be
// made on any thread in any order.

inline uint64_t hash64(uint64_t z) {
  return Random(z).next();
}
inline uint64_t hash64(uint64_t a, uint64_t b) {
  return hash64(hash64(a) ^ b);
}
inline uint64_t hash64(uint64_t a, uint64_t b, uint64_t c) {
  return hash64(hash64(a, b) ^ c);
}

// Uniform in [0, 1).
inline float unit_float(uint64_t h) {
  return static_cast<float>(h >> 40) * 0x1.0p-24F;
}

// Nearly normal, mean 0, standard deviation 1, |value| < 3.5: the sum of four 16-bit uniforms.
inline float normal_from_bits(uint64_t h) {
  const int sum = static_cast<int>(h & 0xFFFF) + static_cast<int>((h >> 16) & 0xFFFF) +
                  static_cast<int>((h >> 32) & 0xFFFF) + static_cast<int>(h >> 48);
  return static_cast<float>(sum - 131070) * (1.7320508F / 65536.0F);
}

// The random value of a lattice point, in [-1, 1).
inline float lattice_value(uint32_t ix, uint32_t iy, uint64_t seed) {
  uint32_t h = ix * 0x85EBCA6BU ^ iy * 0xC2B2AE35U ^ static_cast<uint32_t>(seed);
  h = (h ^ (h >> 15)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12)) * 0x297A2D39U;
  h ^= h >> 15;
  return static_cast<float>(h) * 0x1.0p-31F - 1.0F;
}

// Smooth noise in [-1, 1] with features of size 1, along a row, y fixed and x rising: the corners of a lattice cell are
// looked up once for all pixels in it.
class LatticeRow {
 public:
  LatticeRow(float y, uint64_t seed) : seed_(seed) {
    const float fy = std::floor(y), v = y - fy;
    iy_ = static_cast<uint32_t>(static_cast<int32_t>(fy));
    v_ = v * v * (3 - 2 * v);
    enter(0);
  }
  float at(float x) {
    const float fx = std::floor(x);
    const auto ix = static_cast<uint32_t>(static_cast<int32_t>(fx));
    if (ix != ix_) enter(ix);
    float u = x - fx;
    u = u * u * (3 - 2 * u);
    const float a = corner_[0] * (1 - u) + corner_[1] * u, b = corner_[2] * (1 - u) + corner_[3] * u;
    return a * (1 - v_) + b * v_;
  }

 private:
  void enter(uint32_t ix) {
    ix_ = ix;
    for (uint32_t i = 0; i < 4; ++i) corner_[i] = lattice_value(ix + (i & 1), iy_ + (i >> 1), seed_);
  }
  uint64_t seed_;
  uint32_t ix_ = 0, iy_ = 0;
  float v_ = 0, corner_[4] = {};
};

// Octaves of it along a row, each half as large and half as strong: (*row)[i] is the noise at (step * i, y), in about
// [-1, 1]. Columns of the lattice are blended once for all the pixels between them.
inline void fractal_noise_row(float step, float y, int octaves, uint64_t seed, std::vector<float>* row) {
  std::fill(row->begin(), row->end(), 0.0F);
  float weight = 0.5F;
  for (int octave = 0; octave < octaves; ++octave, step *= 2, y *= 2, weight *= 0.5F) {
    const uint64_t own = seed + static_cast<uint64_t>(octave) * 0x632BE5ABU;
    const float fy = std::floor(y);
    const auto iy = static_cast<uint32_t>(static_cast<int32_t>(fy));
    float v = y - fy;
    v = v * v * (3 - 2 * v);
    const auto column = [&](uint32_t ix) {
      return lattice_value(ix, iy, own) * (1 - v) + lattice_value(ix, iy + 1, own) * v;
    };
    uint32_t cell = 0;
    float left = column(0), right = column(1);
    for (size_t i = 0; i < row->size(); ++i) {
      const float x = step * static_cast<float>(i);
      const auto ix = static_cast<uint32_t>(x);
      if (ix != cell) {
        left = ix == cell + 1 ? right : column(ix);
        right = column(ix + 1);
        cell = ix;
      }
      float u = x - static_cast<float>(ix);
      u = u * u * (3 - 2 * u);
      (*row)[i] += weight * (left * (1 - u) + right * u);
    }
  }
}

}  // namespace dkb::sim
