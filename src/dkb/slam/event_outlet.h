// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <exception>
#include <functional>
#include <iterator>
#include <mutex>
#include <vector>

#include "dkb_slam/slam.h"

namespace dkb {

// The events that nobody has taken yet, and whoever is called for them.
class EventOutlet {
 public:
  void deliver(std::vector<Event> events) {
    if (events.empty()) return;
    // Copied, since a callback may set another one.
    std::function<void(const Event&)> callback;
    Slam::Executor executor;
    {
      const std::lock_guard lock(mutex_);
      callback = callback_;
      executor = executor_;
      if (!callback) {
        for (Event& e : events) waiting_.push_back(std::move(e));
        while (waiting_.size() > kMaxEvents) waiting_.pop_front();
        return;
      }
    }
    // What a callback throws must not cost the events that come after it.
    std::exception_ptr thrown;
    for (const Event& e : events) {
      try {
        if (executor)
          executor([callback, e] { callback(e); });
        else
          callback(e);
      } catch (...) {
        if (!thrown) thrown = std::current_exception();
      }
    }
    if (thrown) std::rethrow_exception(thrown);
  }
  std::vector<Event> take() {
    const std::lock_guard lock(mutex_);
    std::vector<Event> events(std::make_move_iterator(waiting_.begin()), std::make_move_iterator(waiting_.end()));
    waiting_.clear();
    return events;
  }
  void set(std::function<void(const Event&)> callback, Slam::Executor executor) {
    const std::lock_guard lock(mutex_);
    callback_.swap(callback);  // what was there is destroyed after the lock: it may hold anything
    executor_.swap(executor);
  }

 private:
  static constexpr size_t kMaxEvents = 10000;

  std::mutex mutex_;  // guards what follows
  std::function<void(const Event&)> callback_;
  Slam::Executor executor_;
  std::deque<Event> waiting_;
};

}  // namespace dkb
