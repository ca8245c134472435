// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/raster_kernels.h"

#include <gtest/gtest.h>

#include <vector>

#include "dkb/util/random.h"

namespace dkb::sim {
namespace {

float value(Random& random, double low, double high) {
  return static_cast<float>(random.uniform(low, high));
}

struct Row {
  std::vector<float> depth;
  std::vector<int32_t> ids;
  explicit Row(int count) : depth(static_cast<size_t>(count), 0.4F), ids(static_cast<size_t>(count), -1) {}
  bool operator==(const Row&) const = default;
};

Texture noisy_texture(Random& random) {
  Canvas canvas(64, 32, 1, 1);
  canvas.grain(0.2, 0.1, 0.9F, 3, random.next());
  canvas.stain(0.3, {random.next(), {250, 20, 130}}, 0.8F);
  return Texture(canvas);
}

TEST(RasterKernels, PatchIsDrawnWhereItIsInsideAndNearest) {
  // a = i, c = 1: inside for 0 <= i <= 3.
  const PatchSpan span{-2, 1, 0.5F, 0, 1, 0, 0, 3, 0, 1, 7};
  Row row(9);
  row.depth[4] = 2;  // something nearer
  draw_patch_span(span, 9, row.depth.data(), row.ids.data(), Simd::scalar);
  EXPECT_EQ(row.ids, (std::vector<int32_t>{-1, -1, 7, 7, -1, 7, -1, -1, -1}));
}

TEST(RasterKernels, VectorsGiveTheBitsOfTheScalarCode) {
  if (best_simd() == Simd::scalar) GTEST_SKIP() << "skipped: this processor has no AVX2";
  Random random(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int count = 1 + static_cast<int>(random.below(70));
    PatchSpan patch{};
    patch.a0 = value(random, -1, 1), patch.a1 = value(random, -0.05, 0.05);
    patch.b0 = value(random, -1, 1), patch.b1 = value(random, -0.05, 0.05);
    patch.c0 = value(random, 0.2, 1), patch.c1 = value(random, -0.002, 0.01);
    patch.u_high = patch.v_high = 1, patch.id = trial;
    QuadricSpan quadric{};
    for (int i = 0; i < 3; ++i) {
      quadric.d[i] = value(random, -2, 2), quadric.d_step[i] = value(random, -0.1, 0.1);
      quadric.m[i] = value(random, -1, 1), quadric.m_step[i] = value(random, -0.1, 0.1);
    }
    const bool tube = random.below(2) == 0;
    quadric.pivot = value(random, 0.5, 3), quadric.sign = tube ? -1 : 1, quadric.tau = tube ? 0 : 1;
    quadric.taper = tube ? value(random, -0.3, 0.3) : 1, quadric.bias = tube ? 1 : 0;
    quadric.low = tube ? 0 : -2, quadric.high = tube ? 1 : 2, quadric.id = trial + 1;
    Row scalar(count), fast(count);
    draw_patch_span(patch, count, scalar.depth.data(), scalar.ids.data(), Simd::scalar);
    draw_patch_span(patch, count, fast.depth.data(), fast.ids.data(), Simd::avx2);
    draw_quadric_span(quadric, count, scalar.depth.data(), scalar.ids.data(), Simd::scalar);
    draw_quadric_span(quadric, count, fast.depth.data(), fast.ids.data(), Simd::avx2);
    ASSERT_EQ(scalar, fast) << "trial " << trial;
  }
}

TEST(RasterKernels, TexturesOfVectorsAreThoseOfTheScalarCode) {
  if (best_simd() == Simd::scalar) GTEST_SKIP() << "skipped: this processor has no AVX2";
  Random random(6);
  const Texture texture = noisy_texture(random);
  for (int trial = 0; trial < 300; ++trial) {
    const int count = 1 + static_cast<int>(random.below(70));
    TextureSpan span{};
    span.a0 = value(random, -0.1, 1), span.a1 = value(random, -0.02, 0.02);
    span.b0 = value(random, -0.1, 1), span.b1 = value(random, -0.02, 0.02);
    span.c0 = value(random, 0.3, 1), span.c1 = value(random, -0.002, 0.01);
    span.u0 = 0.1F, span.du = 0.8F, span.v0 = 0, span.dv = 1;
    span.texels = value(random, 0.01, 40), span.level_bias = -0.75F, span.level_shift = value(random, 0, 1);
    span.shade = value(random, 0.3, 1.1);
    std::vector<uint64_t> scalar(static_cast<size_t>(count), 3), fast = scalar;
    add_texture_span(span, texture, count, scalar.data(), Simd::scalar);
    add_texture_span(span, texture, count, fast.data(), Simd::avx2);
    ASSERT_EQ(scalar, fast) << "trial " << trial;
  }
}

}  // namespace
}  // namespace dkb::sim
