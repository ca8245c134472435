// SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cstdint>

namespace dkb {

// Which implementation of a kernel runs. All of them give the same bits; the choice only costs or saves time.
enum class Simd : uint8_t { scalar, avx2 };

// The fastest kind that the processor at hand supports.
inline Simd best_simd() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return Simd::avx2;
#endif
  return Simd::scalar;
}

}  // namespace dkb

#if defined(__x86_64__)
#define DKB_TARGET_AVX2 __attribute__((target("avx2,popcnt")))

namespace dkb {

DKB_TARGET_AVX2 inline __m256i load_avx2(const uint8_t* p) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
}

}  // namespace dkb
#endif
