// SPDX-License-Identifier: Apache-2.0
#include "dkb/place/place_index.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>

#include "dkb/util/random.h"

namespace dkb {
namespace {

using Descriptors = std::vector<Descriptor>;

Descriptor random_descriptor(Random& random) {
  return {random.next(), random.next(), random.next(), random.next()};
}

Descriptors random_place(uint64_t seed, int count) {
  Random random(seed);
  Descriptors place;
  for (int i = 0; i < count; ++i) place.push_back(random_descriptor(random));
  return place;
}

// Another look at a place: the first `kept` descriptors with each bit flipped with probability `noise`, the others new.
Descriptors revisit(const Descriptors& place, size_t kept, double noise, Random& random) {
  Descriptors view;
  for (size_t i = 0; i < place.size(); ++i) {
    if (i >= kept) {
      view.push_back(random_descriptor(random));
      continue;
    }
    Descriptor d = place[i];
    for (size_t bit = 0; bit < 256; ++bit)
      if (random.uniform() < noise) d[bit / 64] ^= uint64_t{1} << (bit % 64);
    view.push_back(d);
  }
  return view;
}

PlaceIndex index_of(int places, int descriptors) {
  PlaceIndex index;
  for (int k = 0; k < places; ++k) index.add(k, random_place(static_cast<uint64_t>(k), descriptors));
  return index;
}

std::vector<int32_t> ids_of(const std::vector<PlaceMatch>& matches) {
  std::vector<int32_t> ids;
  for (const PlaceMatch& m : matches) ids.push_back(m.id);
  return ids;
}

// Share of revisits whose place is among the first five answers.
double recall_at_5(const PlaceIndex& index, int places, int descriptors, size_t kept, double noise, uint64_t seed) {
  Random random(seed);
  int found = 0;
  const int queries = 60;
  for (int q = 0; q < queries; ++q) {
    const auto k = static_cast<int32_t>(random.below(static_cast<uint32_t>(places)));
    const auto view = revisit(random_place(static_cast<uint64_t>(k), descriptors), kept, noise, random);
    const auto ids = ids_of(index.query(view, 5));
    found += std::count(ids.begin(), ids.end(), k) > 0;
  }
  return found / static_cast<double>(queries);
}

size_t heap_in_use() {
  const auto info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

TEST(PlaceIndex, EmptyIndexAndEmptyQueryGiveNothing) {
  EXPECT_TRUE(PlaceIndex().query(random_place(1, 10), 5).empty());
  EXPECT_TRUE(index_of(3, 10).query({}, 5).empty());
  EXPECT_TRUE(index_of(3, 10).query(random_place(1, 10), 0).empty());
}

TEST(PlaceIndex, FindsAPlaceByItsOwnDescriptors) {
  const PlaceIndex index = index_of(50, 100);
  const auto matches = index.query(random_place(17, 100), 3);
  ASSERT_FALSE(matches.empty());
  EXPECT_EQ(matches[0].id, 17);
}

TEST(PlaceIndex, SaysWhenItIsFull) {
  PlaceIndex index;
  const Descriptors place = random_place(1, 1);
  for (size_t id = 0; id < PlaceIndex::kMaxKeyframes; ++id) {
    ASSERT_FALSE(index.full());
    index.add(static_cast<int32_t>(id), id % 1000 == 0 ? place : Descriptors{});
  }
  EXPECT_TRUE(index.full());
  EXPECT_THROW(index.add(70000, place), std::length_error);
  index.remove(7);
  EXPECT_FALSE(index.full());
  index.add(70000, place);
  EXPECT_TRUE(index.full());
}

TEST(PlaceIndex, AnswersAreOrderedByScoreThenId) {
  PlaceIndex index;
  const Descriptors place = random_place(1, 200);
  for (int32_t id : {7, 3, 5}) index.add(id, place);
  index.add(1, random_place(2, 200));
  const auto matches = index.query(place, 10);
  ASSERT_GE(matches.size(), 3u);
  EXPECT_EQ((std::vector<int32_t>{matches[0].id, matches[1].id, matches[2].id}), (std::vector<int32_t>{3, 5, 7}));
  EXPECT_EQ(matches[0].score, matches[2].score);
  for (size_t i = 1; i < matches.size(); ++i) EXPECT_LE(matches[i].score, matches[i - 1].score);
}

TEST(PlaceIndex, RecognisesPlacesThroughNoiseAndPartialOverlap) {
  const PlaceIndex index = index_of(200, 1000);
  EXPECT_GE(recall_at_5(index, 200, 1000, 300, 0.10, 1), 0.98);
  EXPECT_GE(recall_at_5(index, 200, 1000, 300, 0.15, 2), 0.98);
  EXPECT_GE(recall_at_5(index, 200, 1000, 100, 0.15, 3), 0.9);
}

TEST(PlaceIndex, LargePlacesDoNotDrownSmallOnes) {
  PlaceIndex index;
  for (int k = 0; k < 20; ++k) index.add(k, random_place(static_cast<uint64_t>(k), k == 4 ? 100 : 3000));
  Random random(6);
  EXPECT_EQ(index.query(revisit(random_place(4, 100), 60, 0.1, random), 1)[0].id, 4);
}

TEST(PlaceIndex, RemovedPlacesAreNotFound) {
  PlaceIndex index = index_of(40, 200);
  for (int32_t id = 0; id < 40; id += 3) index.remove(id);
  index.remove(999);
  EXPECT_EQ(index.size(), 26u);
  for (int32_t id = 0; id < 40; ++id) {
    const auto ids = ids_of(index.query(random_place(static_cast<uint64_t>(id), 200), 40));
    EXPECT_EQ(index.contains(id), id % 3 != 0);
    EXPECT_EQ(std::count(ids.begin(), ids.end(), id), id % 3 != 0 ? 1 : 0);
  }
}

TEST(PlaceIndex, ARemovedIdMayComeBackElsewhere) {
  PlaceIndex index = index_of(10, 200);
  index.remove(4);
  index.add(4, random_place(77, 200));
  const auto found = index.query(random_place(77, 200), 1);
  EXPECT_EQ(found[0].id, 4);
  const auto old = index.query(random_place(4, 200), 1);
  EXPECT_TRUE(old.empty() || old[0].id != 4 || old[0].score < found[0].score / 8);
}

TEST(PlaceIndex, RemovingGivesTheMemoryBack) {
#ifdef DKB_SANITIZED
  GTEST_SKIP() << "a sanitizer has an allocator of its own";
#endif
  const size_t before = heap_in_use();
  PlaceIndex index;
  size_t most = 0;
  for (int k = 0; k < 300; ++k) {
    index.add(k, random_place(static_cast<uint64_t>(k), 500));
    if (k >= 20) index.remove(k - 20);
    if (k == 60) most = heap_in_use() - before;
  }
  EXPECT_EQ(index.size(), 20u);
  EXPECT_LT(heap_in_use() - before, 2 * most);
}

TEST(PlaceIndex, TakesAtMost12KilobytesPerKeyframe) {
#ifdef DKB_SANITIZED
  GTEST_SKIP() << "a sanitizer has an allocator of its own";
#endif
  const size_t before = heap_in_use();
  const PlaceIndex index = index_of(500, 1000);
  EXPECT_LE(heap_in_use() - before, 500u * 12000u);
}

TEST(DescriptorTree, WhatItMeetsGrowsSlowerThanTheMap) {
  // The like entries that a query of a strange place meets cost time. Four times the map must not bring four times as
  // many.
  const auto met = [](int places) {
    std::array<uint8_t, DescriptorTree::kKeyBits> positions;
    std::iota(positions.begin(), positions.end(), uint8_t{0});
    DescriptorTree tree(positions);
    for (int k = 0; k < places; ++k)
      for (const Descriptor& d : random_place(static_cast<uint64_t>(k), 1000)) tree.add(d, static_cast<uint16_t>(k));
    size_t sum = 0;
    tree.find(random_place(123456, 1000), [&](const auto& neighbours) { sum += neighbours.size(); });
    return sum;
  };
  EXPECT_LT(met(800), 2 * met(200));
}

TEST(PlaceIndex, OneDescriptorOverAndOverIsBearable) {
  PlaceIndex index;
  const Descriptors same(1000, Descriptor{1, 2, 3, 4});
  for (int k = 0; k < 30; ++k) index.add(k, same);
  EXPECT_TRUE(index.query(same, 5).empty());  // what all places have tells none from another
  index.add(30, random_place(5, 1000));
  EXPECT_EQ(index.query(random_place(5, 1000), 1)[0].id, 30);
}

TEST(PlaceIndex, IdsMustBeNewAndNotNegative) {
  PlaceIndex index = index_of(2, 10);
  EXPECT_THROW(index.add(1, random_place(9, 10)), std::logic_error);
  EXPECT_THROW(index.add(-1, random_place(9, 10)), std::logic_error);
  EXPECT_EQ(index.size(), 2u);
}

bool same(const std::vector<PlaceMatch>& a, const std::vector<PlaceMatch>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const PlaceMatch& x, const PlaceMatch& y) { return x.id == y.id && x.score == y.score; });
}

TEST(PlaceIndex, TheSameCallsGiveTheSameAnswers) {
  const PlaceIndex a = index_of(60, 300), b = index_of(60, 300);
  for (uint64_t q = 0; q < 20; ++q)
    EXPECT_TRUE(same(a.query(random_place(q, 300), 20), b.query(random_place(q, 300), 20)));
}

TEST(PlaceIndex, CopiesDoNotSeeLaterWrites) {
  PlaceIndex index = index_of(60, 300);
  const PlaceIndex copy = index;
  const auto before = copy.query(random_place(3, 300), 100);
  for (int k = 60; k < 120; ++k) index.add(k, random_place(static_cast<uint64_t>(k), 300));
  for (int k = 0; k < 50; ++k) index.remove(k);
  EXPECT_TRUE(same(copy.query(random_place(3, 300), 100), before));
  EXPECT_EQ(copy.size(), 60u);

  PlaceIndex other = copy;
  other.remove(3);
  other.add(200, random_place(200, 300));
  EXPECT_TRUE(same(copy.query(random_place(3, 300), 100), before));
  EXPECT_EQ(other.query(random_place(200, 300), 1)[0].id, 200);
  EXPECT_EQ(index.query(random_place(100, 300), 1)[0].id, 100);
}

TEST(PlaceIndex, CopiesGiveTheAnswersOfWhatTheyWereCopiedFrom) {
  // Copying at every step, as publishing does, changes no answer.
  PlaceIndex copied;
  std::vector<PlaceIndex> published;
  for (int k = 0; k < 60; ++k) {
    copied.add(k, random_place(static_cast<uint64_t>(k), 300));
    published.push_back(copied);
  }
  const PlaceIndex plain = index_of(60, 300);
  for (uint64_t q = 0; q < 10; ++q)
    EXPECT_TRUE(same(copied.query(random_place(q, 300), 20), plain.query(random_place(q, 300), 20)));
  EXPECT_EQ(published[9].size(), 10u);
}

TEST(PlaceIndex, CopiesAreReadWhileTheOwnerWrites) {  // for the thread sanitizer
  PlaceIndex index = index_of(20, 200);
  const PlaceIndex copy = index;
  const auto before = copy.query(random_place(3, 200), 5);
  std::vector<PlaceMatch> seen;
  std::thread reader([&] {
    for (int i = 0; i < 20; ++i) {
      const PlaceIndex own = copy;
      seen = own.query(random_place(3, 200), 5);
    }
  });
  for (int k = 20; k < 60; ++k) {
    index.add(k, random_place(static_cast<uint64_t>(k), 200));
    if (k % 4 == 0) index.remove(k - 20);
  }
  reader.join();
  EXPECT_TRUE(same(seen, before));
}

TEST(PlaceIndex, AgreesWithABookkeeperThroughRandomEdits) {
  Random random(4);
  PlaceIndex index;
  std::set<int32_t> there;
  for (int step = 0; step < 400; ++step) {
    const auto id = static_cast<int32_t>(random.below(60));
    if (there.count(id) > 0) {
      index.remove(id);
      there.erase(id);
    } else {
      index.add(id, random_place(static_cast<uint64_t>(id), 60));
      there.insert(id);
    }
    ASSERT_EQ(index.size(), there.size());
    if (step % 20 != 0) continue;
    for (int32_t wanted : there)
      ASSERT_EQ(index.query(random_place(static_cast<uint64_t>(wanted), 60), 1)[0].id, wanted) << "step " << step;
  }
}

}  // namespace
}  // namespace dkb
