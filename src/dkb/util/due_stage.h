// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "dkb/util/thread_priority.h"
#include "dkb/util/thrown.h"

namespace dkb {

struct DueStageOptions {
  std::string name;      // of the stage, for the messages of what fails in it
  bool threaded = true;  // false: push() does the work, with the same results
  ThreadPriority priority = ThreadPriority::normal;
};

// Background work whose results become visible at a fixed later frame (logical time), whatever the speed of the
// machine. One task after the other, in order. One thread pushes and takes.
//
// What the work throws is thrown by take_due() at the due frame of that task, as an InputError that names the stage;
// later tasks are worked at all the same.
template <class Task, class Result>
class DueStage {
 public:
  using Work = std::function<Result(const Task&)>;

  DueStage(Work work, DueStageOptions options) : work_(std::move(work)), options_(std::move(options)) {
    if (options_.threaded) thread_ = std::thread([this] { run(); });
  }
  // Lets the task in work end and drops those that wait.
  ~DueStage() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }
  DueStage(const DueStage&) = delete;
  DueStage& operator=(const DueStage&) = delete;

  // Results come in order: none is due before that of the task pushed before.
  void push(Task task, int64_t due) {
    due = last_due_ = std::max(last_due_, due);
    if (!options_.threaded) {
      finished_.push_back(work_at({std::move(task), due}));
      return;
    }
    {
      const std::lock_guard lock(mutex_);
      waiting_.push_back({std::move(task), due});
    }
    changed_.notify_all();
  }
  // The next result that is due at `now`. Waits for it when `wait`, or for as long as `patience` [s] in a real-time
  // run; else takes only what is ready.
  std::optional<Result> take_due(int64_t now, bool wait) { return take(now, wait ? kForever : 0); }
  std::optional<Result> take_due_within(int64_t now, double patience) { return take(now, patience); }
  // Whether a result is due at `now` that is not there yet.
  bool must_wait(int64_t now) const {
    const std::lock_guard lock(mutex_);
    return finished_.empty() && answer_is_due(now);
  }
  // Drops the tasks that nobody has begun. For real-time runs alone.
  void drop_waiting() {
    const std::lock_guard lock(mutex_);
    waiting_.clear();
  }
  // Tasks pushed that are still to be worked at.
  size_t unfinished() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size() + (working_due_ ? 1 : 0);
  }
  // Tasks pushed whose results were not taken.
  size_t outstanding() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size() + (working_due_ ? 1 : 0) + finished_.size();
  }

 private:
  static constexpr double kForever = -1;
  struct Pending {
    Task task;
    int64_t due = 0;
  };
  struct Finished {
    std::optional<Result> result;  // or else the error
    std::exception_ptr error;
    int64_t due = 0;
  };

  Finished work_at(const Pending& pending) const {
    Finished done;
    done.due = pending.due;
    try {
      done.result = work_(pending.task);
    } catch (...) {
      done.error = as_input_error(options_.name);
    }
    return done;
  }
  void run() {
    set_thread_priority(options_.priority);
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
      if (stopping_) return;
      const Pending pending = std::move(waiting_.front());
      waiting_.pop_front();
      working_due_ = pending.due;
      lock.unlock();
      Finished done = work_at(pending);
      lock.lock();
      working_due_.reset();
      finished_.push_back(std::move(done));
      changed_.notify_all();
    }
  }
  bool answer_is_due(int64_t now) const {
    if (!finished_.empty()) return finished_.front().due <= now;
    if (working_due_) return *working_due_ <= now;
    return !waiting_.empty() && waiting_.front().due <= now;
  }
  std::optional<Result> take(int64_t now, double patience) {
    std::unique_lock lock(mutex_);
    const auto settled = [&] { return !finished_.empty() || !answer_is_due(now); };
    if (patience < 0)
      changed_.wait(lock, settled);
    else if (patience > 0)
      changed_.wait_for(lock, std::chrono::duration<double>(patience), settled);
    if (finished_.empty() || finished_.front().due > now) return std::nullopt;
    Finished done = std::move(finished_.front());
    finished_.pop_front();
    if (done.error) std::rethrow_exception(done.error);
    return std::move(done.result);
  }

  const Work work_;
  const DueStageOptions options_;
  int64_t last_due_ = INT64_MIN;  // the pushing thread's own

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<Pending> waiting_;
  std::optional<int64_t> working_due_;
  std::deque<Finished> finished_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace dkb
