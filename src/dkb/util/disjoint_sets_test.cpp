// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/disjoint_sets.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

std::vector<size_t> firsts(DisjointSets& sets, size_t count) {
  std::vector<size_t> firsts;
  for (size_t i = 0; i < count; ++i) firsts.push_back(sets.first_of(i));
  return firsts;
}

TEST(DisjointSets, AreNamedByTheirSmallestWhateverTheOrderOfJoining) {
  DisjointSets sets(7);
  EXPECT_EQ(firsts(sets, 7), (std::vector<size_t>{0, 1, 2, 3, 4, 5, 6}));
  sets.join(6, 4);
  sets.join(4, 2);
  sets.join(1, 5);
  sets.join(5, 1);
  EXPECT_EQ(firsts(sets, 7), (std::vector<size_t>{0, 1, 2, 3, 2, 1, 2}));
  sets.join(6, 5);
  EXPECT_EQ(firsts(sets, 7), (std::vector<size_t>{0, 1, 1, 3, 1, 1, 1}));
}

TEST(DisjointSets, GrowAndBeginAgain) {
  DisjointSets sets;
  for (int i = 0; i < 3; ++i) sets.add();
  sets.join(0, 2);
  EXPECT_EQ(firsts(sets, 3), (std::vector<size_t>{0, 1, 0}));
  sets.clear();
  for (int i = 0; i < 3; ++i) sets.add();
  EXPECT_EQ(firsts(sets, 3), (std::vector<size_t>{0, 1, 2}));
}

}  // namespace
}  // namespace dkb
