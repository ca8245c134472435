// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "dkb/features/simd.h"
#include "dkb/simulator/texture.h"

namespace dkb::sim {

// Inner loops of the rasteriser over `count` neighbouring pixels of a row. Pixel i of a span sees what the linear
// functions a0 + a1 i ... say. Both implementations give the same bits.

// A parallelogram: (a, b, c) = (u, v, 1) / z. Where it is hit inside the limits and nearest, depth (inverse, c) and id
// are replaced.
struct PatchSpan {
  float a0, a1, b0, b1, c0, c1;
  float u_low, u_high, v_low, v_high;
  int32_t id;
};
void draw_patch_span(const PatchSpan& span, int count, float* inverse_depth, int32_t* ids, Simd simd);

// A quadric in its own coordinates: ray direction d, and the ray's point m at depth `pivot`; e = bias + taper m_z is
// the radius at a height (tubes, sign -1, tau 0) or a third coordinate (ellipsoids, sign 1, tau 1).
struct QuadricSpan {
  float d[3], d_step[3], m[3], m_step[3];
  float pivot, sign, tau, taper, bias, low, high;
  int32_t id;
};
void draw_quadric_span(const QuadricSpan& span, int count, float* inverse_depth, int32_t* ids, Simd simd);

// The texture of a patch: adds 1/8 of the shaded colour to `sum` (lanes as in Texture::sample). The level of detail is
// chosen anew every 8 pixels.
struct TextureSpan {
  float a0, a1, b0, b1, c0, c1;
  float u0, du, v0, dv;  // window in the texture
  float texels;          // per pixel area at c = 1
  float level_bias, level_shift, shade;
};
void add_texture_span(const TextureSpan& span, const Texture& texture, int count, uint64_t* sum, Simd simd);

// `shade` in [0, 1] times a colour of 8.8 lanes.
uint64_t shaded(uint64_t colour, float shade);

}  // namespace dkb::sim
