// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/place/descriptor_tree.h"

namespace dkb {

struct PlaceMatch {
  int32_t id = -1;  // keyframe
  float score = 0;  // larger is more similar; to be compared within one query only
};

// Which keyframes look like this one? Learns keyframe by keyframe and needs no vocabulary: an LSH forest finds the
// indexed descriptors like each of the query's, and each votes for its keyframe. Votes count less the more descriptors
// the same leaf offers, as rare words do in text search (tf-idf).
//
// A value with structural sharing: a copy is cheap and costs memory only for what either side changes later. A few
// trees of 4 bytes per descriptor and tree; see bench/place_bench.cpp. Deterministic: the same calls give the same
// results.
class PlaceIndex {
 public:
  static constexpr size_t kMaxKeyframes = size_t{1} << 16;  // slots are 16-bit numbers

  PlaceIndex();

  // `id` >= 0. Throws std::logic_error for a negative id or one that is there, std::length_error when full.
  void add(int32_t id, std::span<const Descriptor> descriptors);
  // An id that is not there is ignored.
  void remove(int32_t id);

  // The most similar keyframes first, at most `max_results`; equal ones by id. Only keyframes with votes are listed.
  std::vector<PlaceMatch> query(std::span<const Descriptor> descriptors, size_t max_results) const;

  // Another keyframe would be one too many.
  bool full() const { return size() >= kMaxKeyframes; }
  bool contains(int32_t id) const { return find(id) != slot_of_id_.end(); }
  size_t size() const { return slot_of_id_.size(); }

 private:
  using IdSlot = std::pair<int32_t, uint16_t>;
  struct Slot {
    int32_t id = -1;           // -1 = free, or its keyframe was removed
    uint32_t descriptors = 0;  // entries that it still has in each tree
  };
  std::vector<IdSlot>::const_iterator find(int32_t id) const;
  uint16_t take_slot();
  void sweep();

  std::vector<DescriptorTree> trees_;
  std::vector<Slot> slots_;
  std::vector<uint16_t> free_;             // slots without entries, the lowest last
  std::vector<IdSlot> slot_of_id_;         // by increasing id
  size_t entries_ = 0, dead_entries_ = 0;  // in each tree
};

}  // namespace dkb
