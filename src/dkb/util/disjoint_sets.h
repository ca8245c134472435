// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace dkb {

// Numbers from 0 on, each alone in a set until sets are joined (union-find). The first, the smallest, of a set stands
// for it.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count = 0) : earlier_(count) { std::iota(earlier_.begin(), earlier_.end(), 0u); }

  void clear() { earlier_.clear(); }
  void add() { earlier_.push_back(static_cast<uint32_t>(earlier_.size())); }
  void join(size_t a, size_t b) {
    const size_t one = first_of(a), other = first_of(b);
    earlier_[std::max(one, other)] = static_cast<uint32_t>(std::min(one, other));
  }
  // Of the set that `i` is in. Halves the way to it.
  size_t first_of(size_t i) {
    while (earlier_[i] != i) i = earlier_[i] = earlier_[earlier_[i]];
    return i;
  }

 private:
  std::vector<uint32_t> earlier_;  // one of the same set, or itself
};

}  // namespace dkb
