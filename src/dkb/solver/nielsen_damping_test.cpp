// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/nielsen_damping.h"

#include <gtest/gtest.h>

namespace dkb::solver {
namespace {

TEST(NielsenDamping, FallsToAThirdWhereTheModelIsRightAndRisesWhereItPromisesTooMuch) {
  NielsenDamping damping(9, 1e-3);
  damping.accept(2, 2);
  EXPECT_DOUBLE_EQ(damping.value(), 3) << "z = 1";
  damping.accept(1, 2);
  EXPECT_DOUBLE_EQ(damping.value(), 3) << "z = 0";
  damping.accept(0.5, 2);
  EXPECT_DOUBLE_EQ(damping.value(), 3 * 1.125) << "z = -1/2";
  for (int i = 0; i < 20; ++i) damping.accept(2, 2);
  EXPECT_EQ(damping.value(), 1e-3);
}

TEST(NielsenDamping, GrowsFasterWithEachRejectedStepInARow) {
  NielsenDamping damping(1, 1e-3);
  EXPECT_TRUE(damping.reject());
  EXPECT_EQ(damping.value(), 2);
  EXPECT_TRUE(damping.reject());
  EXPECT_EQ(damping.value(), 8);
  damping.accept(1, 2);
  EXPECT_TRUE(damping.reject());
  EXPECT_EQ(damping.value(), 16) << "by 2 again";
  int steps = 0;
  while (damping.reject()) ++steps;
  EXPECT_EQ(steps, 6) << "16 * 2^(2 + 3 + ... + 7) = 2^31, and then 2^39";
}

}  // namespace
}  // namespace dkb::solver
