// SPDX-License-Identifier: Apache-2.0
// What a frame asks of memory on the thread that processes it, once the buffers are made: bounded, and no more late in
// a run than early.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <new>

#include "library_support.h"

namespace {

struct Asked {
  size_t times = 0, bytes = 0;
};
thread_local Asked asked;

}  // namespace

// Inlined, a half of a pair looks mismatched to the compiler.
[[gnu::noinline]] void* operator new(size_t size) {
  ++asked.times;
  asked.bytes += size;
  if (void* memory = std::malloc(std::max<size_t>(1, size))) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept {
  std::free(memory);
}

namespace dkb::test {
namespace {

// The most of frames `from` ... `to` - 1 that made no keyframe.
Asked most(Slam& slam, const std::vector<Frame>& frames, size_t from, size_t to) {
  Asked most;
  for (size_t i = from; i < to; ++i) {
    asked = {};
    const FrameResult result = slam.process(frames[i]);
    EXPECT_TRUE(result.tracked()) << i;
    if (result.keyframe) continue;
    most.times = std::max(most.times, asked.times);
    most.bytes = std::max(most.bytes, asked.bytes);
  }
  return most;
}

TEST(Allocations, OfAFrameThatMakesNoKeyframeAreBoundedAndDoNotGrow) {
  const WallWorld world(640, 480);
  const auto frames = world.walk(0, 120, 60);
  for (const bool motion : {false, true}) {
    Detectors detectors = Detectors::none();
    detectors.motion = motion;
    Slam slam(world.camera(), Options(), detectors);
    most(slam, frames, 0, 20);
    const Asked early = most(slam, frames, 20, 60), late = most(slam, frames, 60, 120);
    for (const Asked& a : {early, late}) {
      EXPECT_LE(a.times, motion ? 320u : 200u);
      EXPECT_LE(a.bytes, motion ? 2'700'000u : 2'300'000u);
    }
  }
}

}  // namespace
}  // namespace dkb::test
