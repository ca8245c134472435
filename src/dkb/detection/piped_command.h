// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

#include "dkb/util/errors.h"

namespace dkb {

// What a command makes of an ask() that it ends in: "ended (exit status 1)".
class CommandEnded : public InputError {
 public:
  using InputError::InputError;
};

// A command of the shell, in a process group of its own, that is told something on its standard input and answers on
// its standard output. Its standard error is ours.
class PipedCommand {
 public:
  // Throws InputError when no process can be started.
  explicit PipedCommand(const std::string& command);
  // Ends its input, leaves it a second or two to end in, and kills what is left.
  ~PipedCommand();
  PipedCommand(const PipedCommand&) = delete;
  PipedCommand& operator=(const PipedCommand&) = delete;

  // Tells it `request` and returns its answer, which is there once `size_of(received)` is not 0. Throws CommandEnded
  // when it ends before, InputError when it takes longer than `patience`, or says more than `max_bytes`; of no use from
  // then on. Throws NeverStarted when it ended without a word in the way in which a shell says that there is no such
  // command.
  std::string ask(std::string_view request, const std::function<size_t(std::string_view)>& size_of, size_t max_bytes,
                  std::chrono::milliseconds patience);

 private:
  using Clock = std::chrono::steady_clock;

  // Waits until it takes bytes, gives some or ended its output. False when that is not before `due`.
  bool wait(bool to_send, Clock::time_point due);
  size_t send(std::string_view bytes);
  bool receive();  // false when its output has ended
  int kill();      // its status as of waitpid(); that of SIGKILL where it is not known

  pid_t pid_ = -1;
  int input_ = -1, output_ = -1;        // the command's
  bool takes_ = false, gives_ = false;  // since wait()
  bool spoke_ = false;                  // it gave a byte
  std::string received_;
};

}  // namespace dkb
