// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/features/simd.h"

// Marks the lambdas that run_vectorised() takes: [=]() DKB_KERNEL_BODY { ... }
#define DKB_KERNEL_BODY __attribute__((always_inline))

// Before a loop whose steps have nothing to do with one another: what it writes it does not read elsewhere.
#if defined(__clang__)
#define DKB_INDEPENDENT_STEPS _Pragma("clang loop vectorize(assume_safety)")
#else
#define DKB_INDEPENDENT_STEPS _Pragma("GCC ivdep")
#endif

namespace dkb {

#if defined(__x86_64__)
template <class Kernel>
DKB_TARGET_AVX2 void run_avx2(Kernel kernel) {
  kernel();
}
template <class Kernel>
DKB_TARGET_AVX512 void run_avx512(Kernel kernel) {
  kernel();
}
#endif

// Runs `kernel`, loops without branches over plain arrays that it has copies of the addresses of. The compiler makes
// one version of it per instruction set, each with as many numbers at a time as that has room for. Numbers are not put
// together in another order, so all versions give the same bits.
template <class Kernel>
void run_vectorised([[maybe_unused]] Simd simd, Kernel kernel) {
#if defined(__x86_64__)
  if (simd == Simd::avx512) return run_avx512(kernel);
  if (simd == Simd::avx2) return run_avx2(kernel);
#endif
  kernel();
}

}  // namespace dkb
