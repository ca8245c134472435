// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/place/copy_epoch.h"

namespace dkb {

// One tree of an LSH forest over binary descriptors (Bawa, Condie, Ganesan: LSH Forest, WWW 2005). Descriptors that
// agree in the first bits of a key, which is sampled from them, share a leaf; a leaf that is full splits by the key's
// next bit. So a look-up meets about as many entries in a large tree as in a small one. Of a descriptor the tree keeps
// the slot that it belongs to and the key bits that a leaf may need: 4 bytes.
//
// A value with structural sharing: copies share nodes until either side writes to them.
class DescriptorTree {
 public:
  static constexpr int kRootBits = 10;    // decided by the table at the root
  static constexpr int kStoredBits = 16;  // the rest of the key: decided by splits, or compared within the leaf
  static constexpr int kKeyBits = kRootBits + kStoredBits;
  static constexpr size_t kLeafSize = 256;  // [entries] above which a leaf splits, while there are bits left
  static constexpr size_t kCommon = 1024;   // [entries] a leaf above this says nothing any more

  // `positions`: the descriptor bits that make the key, the first ones decide first.
  explicit DescriptorTree(const std::array<uint8_t, kKeyBits>& positions) : positions_(positions) {}

  void add(const Descriptor& descriptor, uint16_t slot);
  // Drops the entries of all slots that are marked.
  void remove(const std::vector<uint8_t>& marked);

  struct Neighbour {
    uint16_t slot;
    uint8_t distance;   // [bits] among the compared ones
    uint8_t tolerated;  // [bits] largest distance that is listed here
  };
  // Calls visit(neighbours) for each descriptor: the entries in its leaf that differ in at most a quarter of the bits
  // which the path to the leaf left open, in the order in which they were added.
  template <class Visit>
  void find(std::span<const Descriptor> descriptors, Visit&& visit) const {
    std::vector<Neighbour> neighbours;
    const std::vector<Lookup> lookups = look_up(descriptors);
    for (size_t i = 0; i < lookups.size(); ++i) {
      if (i + kAhead < lookups.size()) prefetch(lookups[i + kAhead]);
      compare(lookups[i], neighbours);
      visit(std::as_const(neighbours));
    }
  }

 private:
  using Entry = uint32_t;  // slot in the low half, stored key bits in the high half
  struct Node {
    uint64_t epoch = 0;
    std::vector<Entry> entries;         // of a leaf
    std::shared_ptr<Node> children[2];  // of an inner node: both; of a leaf: none
    bool leaf() const { return !children[0]; }
  };
  static constexpr size_t kBlock = 64;  // nodes that the root's table copies at once
  struct Block {
    uint64_t epoch = 0;
    std::array<std::shared_ptr<Node>, kBlock> nodes;
  };

  // Where the search for a key in the tree has come to.
  struct Lookup {
    const Node* node = nullptr;  // none: nothing is stored there
    uint16_t bits = 0;           // of the key, after the root's
    uint8_t depth = 0;           // how many of them the path decided
  };
  static constexpr size_t kAhead = 6;  // leaves fetched ahead of the one being compared

  uint32_t key_of(const Descriptor& descriptor) const;
  std::vector<Lookup> look_up(std::span<const Descriptor> descriptors) const;
  static void prefetch(const Lookup& lookup);
  static void compare(const Lookup& lookup, std::vector<Neighbour>& neighbours);
  // The part itself when it is ours to write; else a copy that takes its place.
  template <class T>
  T& own(std::shared_ptr<T>& part) const;
  void split(Node& node, int depth) const;
  void remove_below(std::shared_ptr<Node>& node, const std::vector<uint8_t>& marked) const;

  std::array<uint8_t, kKeyBits> positions_;
  CopyEpoch epoch_;
  std::array<std::shared_ptr<Block>, (size_t{1} << kRootBits) / kBlock> root_;
};

}  // namespace dkb
