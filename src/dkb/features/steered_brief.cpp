// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/steered_brief.h"

#include <cmath>
#include <numbers>

#include "dkb/features/brief_tests.h"

namespace dkb {
namespace {

constexpr size_t kTests = kBriefTests.size();

#if defined(__x86_64__)
DKB_TARGET_AVX2 Descriptor describe_avx2(const uint8_t* centre, ptrdiff_t stride, const void* first,
                                         const void* second) {
  const __m256i* a = static_cast<const __m256i*>(first);
  const __m256i* b = static_cast<const __m256i*>(second);
  const __m256i strides = _mm256_set1_epi32(static_cast<int32_t>(static_cast<uint32_t>(stride) << 16 | 1u));
  const __m256i byte = _mm256_set1_epi32(0xFF);
  const int* base = reinterpret_cast<const int*>(centre);
  Descriptor descriptor;
  for (size_t word = 0; word < 4; ++word) {
    uint64_t bits = 0;
    for (size_t k = 0; k < 8; ++k) {
      const __m256i ia = _mm256_madd_epi16(load_avx2(a + 8 * word + k), strides);
      const __m256i ib = _mm256_madd_epi16(load_avx2(b + 8 * word + k), strides);
      const __m256i va = _mm256_and_si256(_mm256_i32gather_epi32(base, ia, 1), byte);
      const __m256i vb = _mm256_and_si256(_mm256_i32gather_epi32(base, ib, 1), byte);
      const int mask = _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(vb, va)));
      bits |= static_cast<uint64_t>(static_cast<uint32_t>(mask)) << (8 * k);
    }
    descriptor[word] = bits;
  }
  return descriptor;
}
#endif

}  // namespace

SteeredBrief::SteeredBrief(Simd simd) : simd_(simd), offsets_(static_cast<size_t>(kRotations) * 2 * kTests) {
  for (int r = 0; r < kRotations; ++r) {
    const double angle = 2.0 * std::numbers::pi * r / kRotations;
    const double c = std::cos(angle), s = std::sin(angle);
    Offset* first = offsets_.data() + static_cast<size_t>(r) * 2 * kTests;
    Offset* second = first + kTests;
    const auto steer = [c, s](double x, double y) {
      return Offset{static_cast<int16_t>(std::lround(c * x - s * y)), static_cast<int16_t>(std::lround(s * x + c * y))};
    };
    for (size_t i = 0; i < kTests; ++i) {
      first[i] = steer(kBriefTests[i].ax, kBriefTests[i].ay);
      second[i] = steer(kBriefTests[i].bx, kBriefTests[i].by);
    }
  }
}

Descriptor SteeredBrief::describe(const uint8_t* centre, ptrdiff_t stride, float angle) const {
  constexpr float kSteps = static_cast<float>(kRotations) / (2.0F * std::numbers::pi_v<float>);
  const int rotation = static_cast<int>(angle * kSteps + 0.5F) % kRotations;
  const Offset* first = offsets_.data() + static_cast<size_t>(rotation) * 2 * kTests;
  const Offset* second = first + kTests;
#if defined(__x86_64__)
  if (simd_ >= Simd::avx2) return describe_avx2(centre, stride, first, second);
#endif
  Descriptor descriptor;
  for (size_t word = 0; word < 4; ++word) {
    uint64_t bits = 0;
    for (size_t k = 0; k < 64; ++k) {
      const Offset a = first[64 * word + k], b = second[64 * word + k];
      bits |= static_cast<uint64_t>(centre[a.y * stride + a.x] < centre[b.y * stride + b.x]) << k;
    }
    descriptor[word] = bits;
  }
  return descriptor;
}

}  // namespace dkb
