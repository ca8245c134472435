// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <thread>
#include <utility>

#include "dkb/util/bounded_queue.h"
#include "dkb/util/thread_priority.h"
#include "dkb/util/timing.h"

namespace dkb {

// Background work whose results become visible at a fixed later frame (logical time), whatever the speed of the
// machine. Due times are frames by index. One task after the other, in order. Without a thread the same work is done
// inside push().
template <class Task, class Result>
class DueStage {
 public:
  using Work = std::function<Result(const Task&)>;

  DueStage(Work work, bool threaded, ThreadPriority priority = ThreadPriority::normal)
      : work_(std::move(work)), tasks_(kSlots), results_(kSlots) {
    if (threaded)
      thread_ = std::thread([this, priority] {
        set_thread_priority(priority);
        while (const auto task = tasks_.pop()) results_.push(work_(*task));
      });
  }
  ~DueStage() { stop(); }
  DueStage(const DueStage&) = delete;
  DueStage& operator=(const DueStage&) = delete;

  // Due times must not fall from one task to the next.
  void push(Task task, int64_t due) {
    due_.push_back(due);
    if (thread_.joinable())
      tasks_.push(std::move(task));
    else
      results_.push(work_(task));
  }
  // The next result that is due at `now`. Waits for it when `wait`; else takes only what is ready.
  std::optional<Result> take_due(int64_t now, bool wait) {
    if (due_.empty() || due_.front() > now) return std::nullopt;
    std::optional<Result> result = wait ? results_.pop() : results_.try_pop();
    if (result) due_.pop_front();
    return result;
  }
  // Tasks pushed whose results were not taken.
  size_t outstanding() const { return due_.size(); }
  // Ends the thread once what is outstanding is finished.
  void stop() {
    tasks_.close();
    if (thread_.joinable()) thread_.join();
  }

 private:
  // More than can ever be outstanding: tracking waits for each task at its due time, or holds back new ones.
  static constexpr size_t kSlots = 4096;
  Work work_;
  BoundedQueue<Task> tasks_;
  BoundedQueue<Result> results_;
  std::deque<int64_t> due_;
  std::thread thread_;
};

}  // namespace dkb
