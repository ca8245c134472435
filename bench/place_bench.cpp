// SPDX-License-Identifier: Apache-2.0
// The place index as the map grows: time of a query, of adding a keyframe to an index of which a copy was published
// just before, memory, and recall of revisits of which 30% of the features come again with a share of their bits
// flipped. Beside it a plain hash index with buckets of a fixed number of bits, whose lists grow with the map.  Usage:
// place_bench [keyframes]
#include <fmt/core.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "dkb/place/place_index.h"
#include "dkb/util/random.h"
#include "dkb/util/timing.h"

namespace {

using namespace dkb;
using Descriptors = std::vector<Descriptor>;

constexpr int kFeatures = 1000, kKept = 300, kQueries = 60;

Descriptor random_descriptor(Random& random) {
  return {random.next(), random.next(), random.next(), random.next()};
}

Descriptors random_place(int seed) {
  Random random(static_cast<uint64_t>(seed) + 1);
  Descriptors place;
  for (int i = 0; i < kFeatures; ++i) place.push_back(random_descriptor(random));
  return place;
}

Descriptors revisit(const Descriptors& place, double noise, Random& random) {
  Descriptors view;
  for (size_t i = 0; i < place.size(); ++i) {
    view.push_back(i < kKept ? place[i] : random_descriptor(random));
    if (i < kKept)
      for (size_t bit = 0; bit < 256; ++bit)
        if (random.uniform() < noise) view[i][bit / 64] ^= uint64_t{1} << (bit % 64);
  }
  return view;
}

// Three tables of 2^16 lists of keyframes, by 16 bits of the descriptor each.
class HashIndex {
 public:
  void add(int32_t id, const Descriptors& place) {
    for (const Descriptor& d : place)
      for (size_t t = 0; t < 3; ++t) lists_[t][(d[t] >> 8) & 0xFFFF].push_back(static_cast<uint16_t>(id));
    ++size_;
  }
  std::vector<PlaceMatch> query(const Descriptors& view, size_t max_results) const {
    std::vector<PlaceMatch> matches(static_cast<size_t>(size_));
    for (size_t i = 0; i < matches.size(); ++i) matches[i].id = static_cast<int32_t>(i);
    for (const Descriptor& d : view)
      for (size_t t = 0; t < 3; ++t) {
        const auto& list = lists_[t][(d[t] >> 8) & 0xFFFF];
        const float weight = std::log1p(static_cast<float>(size_) / static_cast<float>(list.size() + 1));
        for (uint16_t id : list) matches[id].score += weight;
      }
    const auto end = matches.begin() + static_cast<long>(std::min(max_results, matches.size()));
    std::partial_sort(matches.begin(), end, matches.end(),
                      [](const PlaceMatch& a, const PlaceMatch& b) { return a.score > b.score; });
    matches.erase(end, matches.end());
    return matches;
  }

 private:
  int size_ = 0;
  std::vector<std::vector<uint16_t>> lists_[3] = {std::vector<std::vector<uint16_t>>(1 << 16),
                                                  std::vector<std::vector<uint16_t>>(1 << 16),
                                                  std::vector<std::vector<uint16_t>>(1 << 16)};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Asked {
  double query_ms = 0;
  double recall[2] = {0, 0};  // at 10% and 15% of the bits
};

template <class Index>
Asked ask(const Index& index, int keyframes) {
  Asked asked;
  Random random(7);
  std::vector<double> times;
  for (int q = 0; q < 2 * kQueries; ++q) {
    const auto wanted = static_cast<int32_t>(random.below(static_cast<uint32_t>(keyframes)));
    const Descriptors view = revisit(random_place(wanted), q % 2 == 0 ? 0.10 : 0.15, random);
    const Stopwatch watch;
    const auto matches = index.query(view, 5);
    times.push_back(watch.ms());
    asked.recall[q % 2] +=
        std::any_of(matches.begin(), matches.end(), [&](const PlaceMatch& m) { return m.id == wanted; }) /
        double{kQueries};
  }
  asked.query_ms = median(times);
  return asked;
}

size_t heap_in_use() {
  const auto info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

void print_row(const char* name, int keyframes, const Asked& asked, double add_ms, size_t memory) {
  fmt::print("{:>6} | {:>9} | {:8.3f} | {:7.3f} | {:11.2f} | {:8.3f} | {:8.3f}\n", name, keyframes, asked.query_ms,
             add_ms, static_cast<double>(memory) / 1000.0 / keyframes, asked.recall[0], asked.recall[1]);
}

}  // namespace

int main(int argc, char** argv) {
  const int most = argc > 1 ? std::atoi(argv[1]) : 4000;
  fmt::print(" index | keyframes | query ms |  add ms | kB/keyframe | r@5, 10% | r@5, 15%\n");
  PlaceIndex forest, published;
  const size_t start = heap_in_use();
  HashIndex hash;
  size_t hash_bytes = heap_in_use() - start, forest_bytes = 0;
  std::vector<double> add_forest, add_hash;
  for (int k = 0, next = 250; k < most; ++k) {
    const Descriptors place = random_place(k);
    const size_t before = heap_in_use();
    const Stopwatch forest_watch;
    forest.add(k, place);
    add_forest.push_back(forest_watch.ms());
    published = forest;
    const size_t between = heap_in_use();
    const Stopwatch hash_watch;
    hash.add(k, place);
    add_hash.push_back(hash_watch.ms());
    forest_bytes += between - before;
    hash_bytes += heap_in_use() - between;
    if (k + 1 != next) continue;
    print_row("forest", next, ask(forest, next), median(add_forest), forest_bytes);
    print_row("hash", next, ask(hash, next), median(add_hash), hash_bytes);
    add_forest.clear();
    add_hash.clear();
    next *= 2;
  }
  return 0;
}
