// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <thread>

namespace dkb {

// While it lives, Ctrl-C (SIGINT) and SIGTERM do not end the program but call `stop` on a thread of its own. One at a
// time.
class Interrupt {
 public:
  explicit Interrupt(std::function<void()> stop);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static bool happened();  // since the last one was made

 private:
  std::thread thread_;
};

}  // namespace dkb
