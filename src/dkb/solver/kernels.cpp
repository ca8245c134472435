// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/kernels.h"

#include "dkb/util/chi_square.h"

// Groups of four are passed by value only between functions that are inlined into one another.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace dkb::solver {
namespace {

namespace baseline {
#define DKB_KERNEL
#define DKB_WIDE 0
#include "dkb/solver/kernels.inl"
#undef DKB_WIDE
#undef DKB_KERNEL
}  // namespace baseline

#if defined(__x86_64__)
namespace avx2 {
#define DKB_KERNEL __attribute__((target("avx2")))
#define DKB_WIDE 1
#include "dkb/solver/kernels.inl"
#undef DKB_WIDE
#undef DKB_KERNEL
}  // namespace avx2
#endif

}  // namespace

const SolverKernels& baseline_kernels() {
  return baseline::kTable;
}

const SolverKernels& solver_kernels() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return avx2::kTable;
#endif
  return baseline::kTable;
}

}  // namespace dkb::solver
