// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>
#include <functional>
#include <stdexcept>
#include <thread>

namespace dkb {

// Thrown where an interrupt ends a command that leaves nothing behind then; main() makes exit code 130 of it.
struct InterruptedError : std::runtime_error {
  InterruptedError() : std::runtime_error("interrupted before it was done") {}
};

// While it lives, Ctrl-C (SIGINT), SIGTERM and a terminal that goes away (SIGHUP, unless nohup has it ignored) do not
// end the program but call `stop` on a thread of its own. A second Ctrl-C ends the program at once. One at a time.
class Interrupt {
 public:
  explicit Interrupt(std::function<void()> stop);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static bool happened();  // since the last one was made
  static void check();     // throws InterruptedError when it happened

 private:
  struct sigaction before_[3]{};  // the handlers that it took the place of
  std::thread thread_;
};

}  // namespace dkb
