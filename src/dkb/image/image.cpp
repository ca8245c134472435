// SPDX-License-Identifier: Apache-2.0
#include "dkb/image/image.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cstring>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kRed = 4899, kGreen = 9617, kBlue = 1868, kHalf = 8192, kShift = 14;  // BT.601

#if defined(__x86_64__)
// Eight pixels at a time, the same bits as one by one. Returns how many of the `n` it has done: it reads a few bytes
// beyond each eight.
__attribute__((target("avx2"))) size_t grey_avx2(const Rgb* in, size_t n, uint8_t* out) {
  // Of four pixels in each half: red and green, and blue alone, as pairs of 16-bit numbers; then the bytes back.
  const __m256i red_green =
      _mm256_broadcastsi128_si256(_mm_setr_epi8(0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1));
  const __m256i blue =
      _mm256_broadcastsi128_si256(_mm_setr_epi8(2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1));
  const __m256i bytes =
      _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1));
  const __m256i red_green_weights = _mm256_set1_epi32(kGreen << 16 | kRed), blue_weight = _mm256_set1_epi32(kBlue);
  size_t i = 0;
  for (; i + 10 <= n; i += 8) {
    const auto* at = reinterpret_cast<const __m128i*>(in + i);
    const auto* next = reinterpret_cast<const __m128i*>(in + i + 4);
    const __m256i pixels =
        _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128(at)), _mm_loadu_si128(next), 1);
    const __m256i sum = _mm256_add_epi32(_mm256_madd_epi16(_mm256_shuffle_epi8(pixels, red_green), red_green_weights),
                                         _mm256_madd_epi16(_mm256_shuffle_epi8(pixels, blue), blue_weight));
    const __m256i grey = _mm256_srli_epi32(_mm256_add_epi32(sum, _mm256_set1_epi32(kHalf)), kShift);
    const __m256i packed = _mm256_shuffle_epi8(grey, bytes);
    const int four[] = {_mm256_cvtsi256_si32(packed), _mm_cvtsi128_si32(_mm256_extracti128_si256(packed, 1))};
    std::memcpy(out + i, four, sizeof four);
  }
  return i;
}
#endif

struct WithinRange {
  explicit WithinRange(const Camera& camera)
      : low(static_cast<float>(camera.depth_min)), high(static_cast<float>(camera.depth_max)) {}
  float operator()(float depth) const { return depth >= low && depth <= high ? depth : 0.0f; }  // false for NaN
  const float low, high;
};

}  // namespace

GreyImage grey_from_colour(const ColourImage& colour) {
  auto grey = GreyImage::unfilled(colour.width(), colour.height());
  const Rgb* in = colour.data();
  uint8_t* out = grey.data();
  const size_t n = colour.size();
  size_t i = 0;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) i = grey_avx2(in, n, out);
#endif
  for (; i < n; ++i)
    out[i] = static_cast<uint8_t>((kRed * in[i].r + kGreen * in[i].g + kBlue * in[i].b + kHalf) >> kShift);
  return grey;
}

void depth_from_units(const uint16_t* units, size_t count, const Camera& camera, float* metres) {
  const WithinRange within(camera);
  const auto factor = static_cast<float>(camera.depth_factor);
  if (static_cast<double>(factor) == camera.depth_factor)  // one rounding, that of the division
    for (size_t i = 0; i < count; ++i) metres[i] = within(static_cast<float>(units[i]) / factor);
  else
    for (size_t i = 0; i < count; ++i)
      metres[i] = within(static_cast<float>(static_cast<double>(units[i]) / camera.depth_factor));
}

void depth_from_metres(const float* in, size_t count, const Camera& camera, float* metres) {
  const WithinRange within(camera);
  for (size_t i = 0; i < count; ++i) metres[i] = within(in[i]);
}

void leave_out_masked(const Camera& camera, DepthImage& depth) {
  if (!camera.mask) return;
  if (camera.mask->width() != depth.width() || camera.mask->height() != depth.height())
    throw InputError("mask: it is not of the images' size; give the camera a mask of its own size");
  for (size_t i = 0; i < depth.size(); ++i)
    if (camera.mask->data()[i] != 0) depth.data()[i] = 0;
}

}  // namespace dkb
