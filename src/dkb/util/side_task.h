// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "dkb/util/thrown.h"

namespace dkb {

// Work that is done again and again beside the thread that asks for it, on a thread of its own. What that thread has
// not begun when the result is asked for, the asking thread does itself: a machine without a free core loses nothing.
// One thread begins and finishes.
class SideTask {
 public:
  // `name`: of the work, for the message when it fails. `threaded` false: finish() does it, with the same results.
  SideTask(std::string name, std::function<void()> work, bool threaded)
      : name_(std::move(name)), work_(std::move(work)) {
    if (threaded) thread_ = std::thread([this] { run(); });
  }
  ~SideTask() {
    drop();
    state_.store(kStopping, std::memory_order_release);
    state_.notify_one();
    if (thread_.joinable()) thread_.join();
  }
  SideTask(const SideTask&) = delete;
  SideTask& operator=(const SideTask&) = delete;

  void begin() {
    drop();
    state_.store(kOffered, std::memory_order_release);
    if (thread_.joinable()) state_.notify_one();
  }
  // Ends a round that nobody finished, as when something failed in between. What was not begun is not done.
  void drop() {
    settle();
    error_ = nullptr;
  }
  // Returns when the work is done, at once when it was not begun. What it threw it throws as an InputError that names
  // the work.
  void finish() {
    if (!settle()) work();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  enum State : int { kIdle, kOffered, kWorking, kDone, kStopping };

  // Waits for the thread. False when it was asked for work and has not begun: nobody will do it then.
  bool settle() {
    int state = kOffered;
    if (state_.compare_exchange_strong(state, kIdle, std::memory_order_acquire)) return false;
    if (state == kIdle) return true;
    for (; state != kDone; state = state_.load(std::memory_order_acquire))
      state_.wait(state, std::memory_order_acquire);
    state_.store(kIdle, std::memory_order_relaxed);
    return true;
  }
  void work() noexcept {
    try {
      work_();
    } catch (...) {
      error_ = as_input_error(name_);
    }
  }
  void run() {
    while (true) {
      int state = kOffered;
      if (state_.compare_exchange_strong(state, kWorking, std::memory_order_acquire)) {
        work();
        state_.store(kDone, std::memory_order_release);
        state_.notify_one();
      } else if (state == kStopping) {
        return;
      } else {
        state_.wait(state, std::memory_order_acquire);
      }
    }
  }

  const std::string name_;
  const std::function<void()> work_;
  std::exception_ptr error_;  // belongs to whoever moved the state last
  std::atomic<int> state_ = kIdle;
  std::thread thread_;
};

}  // namespace dkb
