// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/raster_kernels.h"

#include <algorithm>
#include <cmath>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace dkb::sim {
namespace {

uint64_t shade_factor(float shade) {
  return static_cast<uint64_t>(std::clamp(shade, 0.0F, 1.0F) * 256.0F);
}

void patch_pixels(const PatchSpan& s, int first, int count, float* __restrict depth, int32_t* __restrict ids) {
  for (int i = first; i < count; ++i) {
    const auto t = static_cast<float>(i);
    const float inverse = s.c0 + s.c1 * t, a = s.a0 + s.a1 * t, b = s.b0 + s.b1 * t;
    const bool in = (a >= s.u_low * inverse) & (a <= s.u_high * inverse) & (b >= s.v_low * inverse) &
                    (b <= s.v_high * inverse) & (inverse > depth[i]);
    depth[i] = in ? inverse : depth[i];
    ids[i] = in ? s.id : ids[i];
  }
}

void quadric_pixels(const QuadricSpan& s, int first, int count, float* __restrict depth, int32_t* __restrict ids) {
  for (int i = first; i < count; ++i) {
    const auto t = static_cast<float>(i);
    const float dx = s.d[0] + s.d_step[0] * t, dy = s.d[1] + s.d_step[1] * t, dz = s.d[2] + s.d_step[2] * t;
    const float mx = s.m[0] + s.m_step[0] * t, my = s.m[1] + s.m_step[1] * t, mz = s.m[2] + s.m_step[2] * t;
    const float g = s.taper * dz, e = s.bias + s.taper * mz;
    const float a = dx * dx + dy * dy + s.sign * g * g, b = dx * mx + dy * my + s.sign * g * e;
    const float c = mx * mx + my * my + s.sign * e * e - s.tau;
    const float root2 = b * b - a * c;
    const float z = (-b - std::sqrt(root2 > 0 ? root2 : 0.0F)) / (a > 1e-12F ? a : 1e-12F);
    const float height = mz + dz * z;
    const float distance = s.pivot + z;
    const float inverse = 1.0F / (distance > 0.01F ? distance : 0.01F);
    const bool in =
        (root2 > 0) & (a > 1e-12F) & (height >= s.low) & (height <= s.high) & (distance > 0.02F) & (inverse > depth[i]);
    depth[i] = in ? inverse : depth[i];
    ids[i] = in ? s.id : ids[i];
  }
}

int texture_level(const TextureSpan& s, const Texture& texture, int pixel) {
  const float scale = 1.0F / (s.c0 + s.c1 * static_cast<float>(pixel));
  const float lod = 0.5F * std::log2(s.texels * scale * scale * scale + 1e-6F) + s.level_bias + s.level_shift;
  return std::clamp(static_cast<int>(std::floor(lod)), 0, texture.levels() - 1);
}

void texture_pixels(const TextureSpan& s, const Texture& texture, int first, int count, uint64_t* sum) {
  int level = 0;
  for (int i = first; i < count; ++i) {
    const auto t = static_cast<float>(i);
    const float scale = 1.0F / (s.c0 + s.c1 * t);
    if ((i & 7) == 0) level = texture_level(s, texture, i);
    const float u = s.u0 + s.du * (s.a0 + s.a1 * t) * scale;
    const float v = s.v0 + s.dv * (s.b0 + s.b1 * t) * scale;
    sum[i] += (shaded(texture.sample(u, v, level), s.shade) >> 3) & 0x1FFF1FFF1FFF1FFFULL;
  }
}

#if defined(__x86_64__)

// Pixel numbers i ... i + 7.
DKB_TARGET_AVX2 inline __m256 numbers_from(int i) {
  return _mm256_cvtepi32_ps(_mm256_add_epi32(_mm256_set1_epi32(i), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)));
}
DKB_TARGET_AVX2 inline __m256 linear(float at0, float step, __m256 t) {
  return _mm256_add_ps(_mm256_set1_ps(at0), _mm256_mul_ps(_mm256_set1_ps(step), t));
}
DKB_TARGET_AVX2 inline __m256 times(__m256 x, float k) {
  return _mm256_mul_ps(_mm256_set1_ps(k), x);
}
DKB_TARGET_AVX2 inline __m256 product_sum(__m256 a, __m256 b, __m256 c, __m256 d) {
  return _mm256_add_ps(_mm256_mul_ps(a, b), _mm256_mul_ps(c, d));
}
DKB_TARGET_AVX2 inline void replace(__m256 in, __m256 inverse, __m256 old, int32_t id, float* depth, int32_t* ids) {
  _mm256_storeu_ps(depth, _mm256_blendv_ps(old, inverse, in));
  auto* target = reinterpret_cast<__m256i*>(ids);
  _mm256_storeu_si256(target,
                      _mm256_blendv_epi8(_mm256_loadu_si256(target), _mm256_set1_epi32(id), _mm256_castps_si256(in)));
}

DKB_TARGET_AVX2 int patch_pixels_avx2(const PatchSpan& s, int count, float* depth, int32_t* ids) {
  int i = 0;
  for (; i + 8 <= count; i += 8) {
    const __m256 t = numbers_from(i), old = _mm256_loadu_ps(depth + i);
    const __m256 inverse = linear(s.c0, s.c1, t), a = linear(s.a0, s.a1, t), b = linear(s.b0, s.b1, t);
    __m256 in = _mm256_cmp_ps(inverse, old, _CMP_GT_OQ);
    in = _mm256_and_ps(in, _mm256_cmp_ps(a, times(inverse, s.u_low), _CMP_GE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(a, times(inverse, s.u_high), _CMP_LE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(b, times(inverse, s.v_low), _CMP_GE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(b, times(inverse, s.v_high), _CMP_LE_OQ));
    replace(in, inverse, old, s.id, depth + i, ids + i);
  }
  return i;
}

DKB_TARGET_AVX2 int quadric_pixels_avx2(const QuadricSpan& s, int count, float* depth, int32_t* ids) {
  const __m256 sign = _mm256_set1_ps(s.sign), taper = _mm256_set1_ps(s.taper), zero = _mm256_setzero_ps();
  const __m256 min_norm2 = _mm256_set1_ps(1e-12F);
  int i = 0;
  for (; i + 8 <= count; i += 8) {
    const __m256 t = numbers_from(i), old = _mm256_loadu_ps(depth + i);
    const __m256 dx = linear(s.d[0], s.d_step[0], t), dy = linear(s.d[1], s.d_step[1], t),
                 dz = linear(s.d[2], s.d_step[2], t);
    const __m256 mx = linear(s.m[0], s.m_step[0], t), my = linear(s.m[1], s.m_step[1], t),
                 mz = linear(s.m[2], s.m_step[2], t);
    const __m256 g = _mm256_mul_ps(taper, dz), e = _mm256_add_ps(_mm256_set1_ps(s.bias), _mm256_mul_ps(taper, mz));
    const __m256 sign_g = _mm256_mul_ps(sign, g);
    const __m256 a = _mm256_add_ps(product_sum(dx, dx, dy, dy), _mm256_mul_ps(sign_g, g));
    const __m256 b = _mm256_add_ps(product_sum(dx, mx, dy, my), _mm256_mul_ps(sign_g, e));
    const __m256 c = _mm256_sub_ps(_mm256_add_ps(product_sum(mx, mx, my, my), _mm256_mul_ps(_mm256_mul_ps(sign, e), e)),
                                   _mm256_set1_ps(s.tau));
    const __m256 root2 = _mm256_sub_ps(_mm256_mul_ps(b, b), _mm256_mul_ps(a, c));
    __m256 in = _mm256_and_ps(_mm256_cmp_ps(root2, zero, _CMP_GT_OQ), _mm256_cmp_ps(a, min_norm2, _CMP_GT_OQ));
    if (_mm256_movemask_ps(in) == 0) continue;
    const __m256 minus_b = _mm256_xor_ps(b, _mm256_set1_ps(-0.0F));
    // max(x, y) is y when x is not greater: the same choice as the scalar code's.
    const __m256 z =
        _mm256_div_ps(_mm256_sub_ps(minus_b, _mm256_sqrt_ps(_mm256_max_ps(root2, zero))), _mm256_max_ps(a, min_norm2));
    const __m256 height = _mm256_add_ps(mz, _mm256_mul_ps(dz, z));
    const __m256 distance = _mm256_add_ps(_mm256_set1_ps(s.pivot), z);
    const __m256 inverse = _mm256_div_ps(_mm256_set1_ps(1.0F), _mm256_max_ps(distance, _mm256_set1_ps(0.01F)));
    in = _mm256_and_ps(in, _mm256_cmp_ps(height, _mm256_set1_ps(s.low), _CMP_GE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(height, _mm256_set1_ps(s.high), _CMP_LE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(distance, _mm256_set1_ps(0.02F), _CMP_GT_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(inverse, old, _CMP_GT_OQ));
    replace(in, inverse, old, s.id, depth + i, ids + i);
  }
  return i;
}

// Two of the four 16-bit lanes of eight pixels' blends: those that `texel` shows in bits 0 ... 7 and 16 ... 23.
struct Corners {
  __m256i c00, c10, c01, c11;
};
DKB_TARGET_AVX2 inline __m256i between(__m256i p, __m256i q, __m256i weight) {
  return _mm256_add_epi16(_mm256_mullo_epi16(p, _mm256_sub_epi16(_mm256_set1_epi16(256), weight)),
                          _mm256_mullo_epi16(q, weight));
}
DKB_TARGET_AVX2 inline __m256i even_bytes(__m256i c) {
  return _mm256_and_si256(c, _mm256_set1_epi32(0x00FF00FF));
}
DKB_TARGET_AVX2 inline __m256i odd_bytes(__m256i c) {
  return even_bytes(_mm256_srli_epi32(c, 8));
}
// Texel coordinate in 1/256 along a side of `size` texels, cut to the texture.
DKB_TARGET_AVX2 inline __m256i coordinate(float origin, float extent, __m256 along, __m256 scale, int size) {
  const __m256 u = _mm256_add_ps(_mm256_set1_ps(origin), _mm256_mul_ps(times(along, extent), scale));
  const __m256 x = _mm256_sub_ps(times(u, static_cast<float>(size)), _mm256_set1_ps(0.5F));
  const __m256i steps = _mm256_cvttps_epi32(times(_mm256_max_ps(x, _mm256_setzero_ps()), 256.0F));
  return _mm256_min_epi32(steps, _mm256_set1_epi32((size - 1) << 8));
}
DKB_TARGET_AVX2 inline __m256i blend(const Corners& c, __m256i a, __m256i b, __m256i shade) {
  const __m256i top = _mm256_srli_epi16(between(c.c00, c.c10, a), 8);
  const __m256i bottom = _mm256_srli_epi16(between(c.c01, c.c11, a), 8);
  const __m256i colour = _mm256_srli_epi16(between(top, bottom, b), 8);
  return _mm256_srli_epi16(_mm256_mullo_epi16(colour, shade), 3);
}

DKB_TARGET_AVX2 int texture_pixels_avx2(const TextureSpan& s, const Texture& texture, int count, uint64_t* sum) {
  const __m256i shade = _mm256_set1_epi16(static_cast<int16_t>(shade_factor(s.shade)));
  const __m256i fraction = _mm256_set1_epi32(255);
  int i = 0;
  for (; i + 8 <= count; i += 8) {
    const Texture::Level level = texture.level(texture_level(s, texture, i));
    const __m256 t = numbers_from(i);
    const __m256 scale = _mm256_div_ps(_mm256_set1_ps(1.0F), linear(s.c0, s.c1, t));
    const __m256i xf = coordinate(s.u0, s.du, linear(s.a0, s.a1, t), scale, level.width);
    const __m256i yf = coordinate(s.v0, s.dv, linear(s.b0, s.b1, t), scale, level.height);
    const __m256i x0 = _mm256_srai_epi32(xf, 8), y0 = _mm256_srai_epi32(yf, 8);
    // A comparison that holds is -1.
    const __m256i x1 = _mm256_sub_epi32(x0, _mm256_cmpgt_epi32(_mm256_set1_epi32(level.width - 1), x0));
    const __m256i y1 = _mm256_sub_epi32(y0, _mm256_cmpgt_epi32(_mm256_set1_epi32(level.height - 1), y0));
    const __m256i row = _mm256_set1_epi32(level.width);
    const __m256i row0 = _mm256_mullo_epi32(y0, row), row1 = _mm256_mullo_epi32(y1, row);
    const int* texels = reinterpret_cast<const int*>(level.texels);
    const __m256i c00 = _mm256_i32gather_epi32(texels, _mm256_add_epi32(row0, x0), 4);
    const __m256i c10 = _mm256_i32gather_epi32(texels, _mm256_add_epi32(row0, x1), 4);
    const __m256i c01 = _mm256_i32gather_epi32(texels, _mm256_add_epi32(row1, x0), 4);
    const __m256i c11 = _mm256_i32gather_epi32(texels, _mm256_add_epi32(row1, x1), 4);
    __m256i a = _mm256_and_si256(xf, fraction), b = _mm256_and_si256(yf, fraction);
    a = _mm256_or_si256(a, _mm256_slli_epi32(a, 16));
    b = _mm256_or_si256(b, _mm256_slli_epi32(b, 16));
    const __m256i red_blue = blend({even_bytes(c00), even_bytes(c10), even_bytes(c01), even_bytes(c11)}, a, b, shade);
    const __m256i green = blend({odd_bytes(c00), odd_bytes(c10), odd_bytes(c01), odd_bytes(c11)}, a, b, shade);
    const __m256i pairs0 = _mm256_unpacklo_epi32(red_blue, green), pairs1 = _mm256_unpackhi_epi32(red_blue, green);
    auto* target = reinterpret_cast<__m256i*>(sum + i);
    const __m256i first = _mm256_permute2x128_si256(pairs0, pairs1, 0x20);
    const __m256i second = _mm256_permute2x128_si256(pairs0, pairs1, 0x31);
    _mm256_storeu_si256(target, _mm256_add_epi64(_mm256_loadu_si256(target), first));
    _mm256_storeu_si256(target + 1, _mm256_add_epi64(_mm256_loadu_si256(target + 1), second));
  }
  return i;
}

#endif

}  // namespace

uint64_t shaded(uint64_t colour, float shade) {
  return ((colour >> 8) & 0x00FF00FF00FF00FFULL) * shade_factor(shade);
}

void draw_patch_span(const PatchSpan& span, int count, float* inverse_depth, int32_t* ids, [[maybe_unused]] Simd simd) {
  int done = 0;
#if defined(__x86_64__)
  if (simd >= Simd::avx2) done = patch_pixels_avx2(span, count, inverse_depth, ids);
#endif
  patch_pixels(span, done, count, inverse_depth, ids);
}

void draw_quadric_span(const QuadricSpan& span, int count, float* inverse_depth, int32_t* ids,
                       [[maybe_unused]] Simd simd) {
  int done = 0;
#if defined(__x86_64__)
  if (simd >= Simd::avx2) done = quadric_pixels_avx2(span, count, inverse_depth, ids);
#endif
  quadric_pixels(span, done, count, inverse_depth, ids);
}

void add_texture_span(const TextureSpan& span, const Texture& texture, int count, uint64_t* sum,
                      [[maybe_unused]] Simd simd) {
  int done = 0;
#if defined(__x86_64__)
  if (simd >= Simd::avx2) done = texture_pixels_avx2(span, texture, count, sum);
#endif
  texture_pixels(span, texture, done, count, sum);
}

}  // namespace dkb::sim
