// SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cstdint>

namespace dkb {

// Which implementation of a kernel runs, each for processors that can do what those before it need as well. All of them
// give the same bits; the choice only costs or saves time.
enum class Simd : uint8_t { scalar, avx2, avx512 };

// The fastest kind that the processor at hand supports.
inline Simd best_simd() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2")) return Simd::scalar;
  const bool wide = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  return wide ? Simd::avx512 : Simd::avx2;
#else
  return Simd::scalar;
#endif
}

}  // namespace dkb

#if defined(__x86_64__)
#define DKB_TARGET_AVX2 __attribute__((target("avx2,popcnt")))
#if defined(__clang__)
#define DKB_WHOLE_WIDTH  // which Clang cannot be told here, and without which it uses all of it
#else
#define DKB_WHOLE_WIDTH ",prefer-vector-width=512"
#endif
#define DKB_TARGET_AVX512 __attribute__((target("avx2,popcnt,avx512f,avx512bw,avx512dq,avx512vl" DKB_WHOLE_WIDTH)))

namespace dkb {

DKB_TARGET_AVX2 inline __m256i load_avx2(const void* p) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(p));
}

// Of eight 32-bit numbers.
DKB_TARGET_AVX2 inline int32_t sum_avx2(__m256i v) {
  __m128i s = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0x4E));
  s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0xB1));
  return _mm_cvtsi128_si32(s);
}

}  // namespace dkb
#endif
