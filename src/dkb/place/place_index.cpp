// SPDX-License-Identifier: Apache-2.0
#include "dkb/place/place_index.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr size_t kTrees = 2;

// Each tree has bits of its own, drawn once and for all.
std::vector<DescriptorTree> make_trees() {
  std::array<uint8_t, 256> order;
  std::iota(order.begin(), order.end(), uint8_t{0});
  Random random(20);
  for (uint32_t i = 255; i > 0; --i) std::swap(order[i], order[random.below(i + 1)]);
  std::vector<DescriptorTree> trees;
  for (size_t t = 0; t < kTrees; ++t) {
    std::array<uint8_t, DescriptorTree::kKeyBits> positions;
    std::copy_n(order.begin() + static_cast<long>(t * positions.size()), positions.size(), positions.begin());
    trees.emplace_back(positions);
  }
  return trees;
}

}  // namespace

PlaceIndex::PlaceIndex() : trees_(make_trees()) {}

std::vector<PlaceIndex::IdSlot>::const_iterator PlaceIndex::find(int32_t id) const {
  const auto at = std::lower_bound(slot_of_id_.begin(), slot_of_id_.end(), IdSlot{id, 0});
  return at != slot_of_id_.end() && at->first == id ? at : slot_of_id_.end();
}

uint16_t PlaceIndex::take_slot() {
  if (free_.empty() && slots_.size() == kMaxKeyframes) sweep();
  if (!free_.empty()) {
    const uint16_t slot = free_.back();
    free_.pop_back();
    return slot;
  }
  if (slots_.size() == kMaxKeyframes)
    throw std::length_error("place index: more than " + std::to_string(kMaxKeyframes) + " keyframes");
  slots_.emplace_back();
  return static_cast<uint16_t>(slots_.size() - 1);
}

void PlaceIndex::add(int32_t id, std::span<const Descriptor> descriptors) {
  if (id < 0) throw std::logic_error("place index: negative id " + std::to_string(id));
  if (contains(id)) throw std::logic_error("place index: keyframe " + std::to_string(id) + " is there already");
  const uint16_t slot = take_slot();
  slots_[slot] = {id, static_cast<uint32_t>(descriptors.size())};
  slot_of_id_.insert(std::upper_bound(slot_of_id_.begin(), slot_of_id_.end(), IdSlot{id, 0}), {id, slot});
  for (DescriptorTree& tree : trees_)
    for (const Descriptor& d : descriptors) tree.add(d, slot);
  entries_ += descriptors.size();
}

void PlaceIndex::remove(int32_t id) {
  const auto at = find(id);
  if (at == slot_of_id_.end()) return;
  Slot& slot = slots_[at->second];
  slot.id = -1;
  dead_entries_ += slot.descriptors;
  slot_of_id_.erase(at);
  // Entries stay until they are a fourth of all: then one walk through the trees frees them together.
  if (4 * dead_entries_ > entries_) sweep();
}

void PlaceIndex::sweep() {
  std::vector<uint8_t> marked(slots_.size(), 0);
  free_.clear();
  for (size_t s = slots_.size(); s-- > 0;) {
    if (slots_[s].id >= 0) continue;
    marked[s] = 1;
    slots_[s].descriptors = 0;
    free_.push_back(static_cast<uint16_t>(s));
  }
  for (DescriptorTree& tree : trees_) tree.remove(marked);
  entries_ -= dead_entries_;
  dead_entries_ = 0;
}

std::vector<PlaceMatch> PlaceIndex::query(std::span<const Descriptor> descriptors, size_t max_results) const {
  std::vector<float> scores(slots_.size(), 0.0f);
  std::vector<float> rarity(DescriptorTree::kCommon + 1, 0.0f);
  for (size_t n = 1; n < rarity.size(); ++n) rarity[n] = std::log1p(static_cast<float>(size()) / static_cast<float>(n));
  for (const DescriptorTree& tree : trees_)
    tree.find(descriptors, [&](const std::vector<DescriptorTree::Neighbour>& neighbours) {
      const float weight = rarity[neighbours.size()];
      for (const auto& n : neighbours)
        scores[n.slot] +=
            weight * static_cast<float>(n.tolerated + 1 - n.distance) / static_cast<float>(n.tolerated + 1);
    });
  std::vector<PlaceMatch> matches;
  for (const auto& [id, slot] : slot_of_id_)
    if (scores[slot] > 0)
      matches.push_back({id, scores[slot] / std::sqrt(static_cast<float>(slots_[slot].descriptors))});
  const auto end = matches.begin() + static_cast<long>(std::min(max_results, matches.size()));
  std::partial_sort(matches.begin(), end, matches.end(), [](const PlaceMatch& a, const PlaceMatch& b) {
    return a.score != b.score ? a.score > b.score : a.id < b.id;
  });
  matches.erase(end, matches.end());
  return matches;
}

}  // namespace dkb
