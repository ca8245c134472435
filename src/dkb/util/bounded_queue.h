// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>

namespace dkb {

// First-in first-out queue between two threads. pop() waits while it is empty. After close() pushes are refused and
// pops drain what is left, then return nothing: that is how a stage ends.
template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t capacity) : capacity_(capacity) {}

  // Never waits: when full, the oldest item is dropped, and `leave_to(dropped, waiting)` may hand what it held to those
  // that wait, the oldest first. Returns how many were dropped (0 or 1).
  template <class LeaveTo>
  size_t push_dropping_oldest(T value, const LeaveTo& leave_to) {
    std::unique_lock lock(mutex_);
    size_t dropped = 0;
    if (!closed_) items_.push_back(std::move(value));
    if (items_.size() > capacity_) {
      const T oldest = std::move(items_.front());
      items_.pop_front();
      leave_to(oldest, items_);
      dropped = 1;
    }
    not_empty_.notify_one();
    return dropped;
  }
  std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    not_empty_.wait(lock, [&] { return closed_ || !items_.empty(); });
    if (items_.empty()) return std::nullopt;
    std::optional<T> value(std::move(items_.front()));
    items_.pop_front();
    return value;
  }
  void close() {
    std::unique_lock lock(mutex_);
    closed_ = true;
    not_empty_.notify_all();
  }

 private:
  const size_t capacity_;
  std::mutex mutex_;
  std::condition_variable not_empty_;
  std::deque<T> items_;
  bool closed_ = false;
};

}  // namespace dkb
