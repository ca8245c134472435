// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace dkb {

// Who owns what, for values with structural sharing (copy on write). A container holds a CopyEpoch; each of its shared
// parts carries the epoch in which the container made it. The container may write to parts of its own epoch, and makes
// itself a copy of any other before it writes.
//
// Copying a container puts both sides into an epoch that is newer than every part they share. Several threads may copy
// the same container while nobody writes to it.
class CopyEpoch {
 public:
  CopyEpoch() = default;
  CopyEpoch(const CopyEpoch& other) : value_(other.advance()) {}
  CopyEpoch(CopyEpoch&& other) noexcept : value_(other.value()) {}
  CopyEpoch& operator=(const CopyEpoch& other) {
    value_.store(other.advance(), std::memory_order_relaxed);
    return *this;
  }
  CopyEpoch& operator=(CopyEpoch&& other) noexcept {
    value_.store(other.value(), std::memory_order_relaxed);
    return *this;
  }
  uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  uint64_t advance() const { return value_.fetch_add(1, std::memory_order_relaxed) + 1; }
  mutable std::atomic<uint64_t> value_{1};
};

}  // namespace dkb
