// SPDX-License-Identifier: Apache-2.0
#include "dkb/place/descriptor_tree.h"

#include <algorithm>

namespace dkb {
namespace {

// Set bits among the low 16, written so that compilers turn a loop of it into vector code of any machine.
inline uint32_t popcount16(uint32_t x) {
  x -= (x >> 1) & 0x5555;
  x = (x & 0x3333) + ((x >> 2) & 0x3333);
  x = (x + (x >> 4)) & 0x0f0f;
  return (x + (x >> 8)) & 0x1f;
}

// Grows by a sixteenth: leaves are many, and doubling would waste a third of the memory.
void append(std::vector<uint32_t>& entries, uint32_t entry) {
  if (entries.size() == entries.capacity()) entries.reserve(entries.size() + entries.size() / 16 + 4);
  entries.push_back(entry);
}

}  // namespace

uint32_t DescriptorTree::key_of(const Descriptor& descriptor) const {
  uint32_t key = 0;
  for (size_t i = 0; i < positions_.size(); ++i) {
    const uint8_t at = positions_[i];
    key |= static_cast<uint32_t>((descriptor[at / 64] >> (at % 64)) & 1) << i;
  }
  return key;
}

template <class T>
T& DescriptorTree::own(std::shared_ptr<T>& part) const {
  if (!part) {
    part = std::make_shared<T>();
  } else if (part->epoch != epoch_.value()) {
    part = std::make_shared<T>(*part);
  }
  part->epoch = epoch_.value();
  return *part;
}

void DescriptorTree::add(const Descriptor& descriptor, uint16_t slot) {
  const uint32_t key = key_of(descriptor);
  const uint32_t root = key & ((1u << kRootBits) - 1), bits = key >> kRootBits;
  Node* node = &own(own(root_[root / kBlock]).nodes[root % kBlock]);
  int depth = 0;
  while (!node->leaf()) node = &own(node->children[(bits >> depth++) & 1]);
  append(node->entries, bits << 16 | slot);
  if (node->entries.size() > kLeafSize && depth < kStoredBits) split(*node, depth);
}

void DescriptorTree::split(Node& node, int depth) const {
  for (auto& child : node.children) own(child);
  for (Entry e : node.entries) append(node.children[(e >> (16 + depth)) & 1]->entries, e);
  node.entries = std::vector<Entry>();  // {} would keep the memory
  for (auto& child : node.children)
    if (child->entries.size() > kLeafSize && depth + 1 < kStoredBits) split(*child, depth + 1);
}

void DescriptorTree::remove(const std::vector<uint8_t>& marked) {
  for (auto& block : root_) {
    if (!block) continue;
    for (auto& node : own(block).nodes)
      if (node) remove_below(node, marked);
  }
}

void DescriptorTree::remove_below(std::shared_ptr<Node>& node, const std::vector<uint8_t>& marked) const {
  if (!node->leaf()) {
    for (auto& child : own(node).children) remove_below(child, marked);
    return;
  }
  const auto gone = [&](Entry e) { return marked[e & 0xFFFF] != 0; };
  if (std::none_of(node->entries.begin(), node->entries.end(), gone)) return;
  std::erase_if(own(node).entries, gone);
}

// All searches go down level by level together: the loads of one level do not wait for one another, so the processor
// fetches many at once. One search after the other takes about twice as long in a map larger than the cache.
std::vector<DescriptorTree::Lookup> DescriptorTree::look_up(std::span<const Descriptor> descriptors) const {
  std::vector<Lookup> lookups(descriptors.size());
  for (size_t i = 0; i < lookups.size(); ++i) {
    const uint32_t key = key_of(descriptors[i]);
    const uint32_t root = key & ((1u << kRootBits) - 1);
    lookups[i].bits = static_cast<uint16_t>(key >> kRootBits);
    if (const auto& block = root_[root / kBlock]) lookups[i].node = block->nodes[root % kBlock].get();
  }
  for (bool descending = true; descending;) {
    descending = false;
    for (Lookup& l : lookups) {
      if (l.node == nullptr || l.node->leaf()) continue;
      l.node = l.node->children[(l.bits >> l.depth++) & 1].get();
      descending = true;
    }
  }
  return lookups;
}

void DescriptorTree::prefetch(const Lookup& lookup) {
  if (lookup.node == nullptr) return;
  const auto* from = reinterpret_cast<const char*>(lookup.node->entries.data());
  const size_t bytes = std::min(lookup.node->entries.size(), kLeafSize) * sizeof(Entry);
  for (size_t b = 0; b < bytes; b += 64) __builtin_prefetch(from + b);
}

void DescriptorTree::compare(const Lookup& lookup, std::vector<Neighbour>& neighbours) {
  neighbours.clear();
  if (lookup.node == nullptr || lookup.node->entries.size() > kCommon) return;
  const uint32_t open = (0xFFFFu << lookup.depth) & 0xFFFFu;
  const auto tolerated = static_cast<uint8_t>((kStoredBits - lookup.depth) / 4);
  std::array<uint8_t, kLeafSize> distance;
  for (size_t from = 0; from < lookup.node->entries.size(); from += kLeafSize) {
    const Entry* entries = lookup.node->entries.data() + from;
    const size_t n = std::min(kLeafSize, lookup.node->entries.size() - from);
    for (size_t i = 0; i < n; ++i)
      distance[i] = static_cast<uint8_t>(popcount16(((entries[i] >> 16) ^ lookup.bits) & open));
    for (size_t i = 0; i < n; ++i)
      if (distance[i] <= tolerated)
        neighbours.push_back({static_cast<uint16_t>(entries[i] & 0xFFFF), distance[i], tolerated});
  }
}

}  // namespace dkb
