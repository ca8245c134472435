// SPDX-License-Identifier: Apache-2.0
#include "interrupt.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>

namespace dkb {
namespace {

// A handler may do little more than write to a pipe; the thread that reads it does the rest.
std::atomic<bool> interrupted{false};
std::atomic<int> pipe_in{-1};
constexpr char kInterrupted = 'i', kQuit = 'q';

void on_signal(int) {
  const int saved = errno;
  interrupted = true;
  if (const int fd = pipe_in; fd >= 0) static_cast<void>(!write(fd, &kInterrupted, 1));
  errno = saved;
}

}  // namespace

bool Interrupt::happened() {
  return interrupted;
}

Interrupt::Interrupt(std::function<void()> stop) {
  interrupted = false;
  int fds[2];
  if (pipe2(fds, O_CLOEXEC) == 0) {
    pipe_in = fds[1];
    thread_ = std::thread([out = fds[0], stop = std::move(stop)] {
      char what = 0;
      for (;;) {
        const ssize_t n = read(out, &what, 1);
        if (n < 0 && errno == EINTR) continue;
        if (n != 1 || what == kQuit) break;
        stop();
      }
      close(out);
    });
  }
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

Interrupt::~Interrupt() {
  const int fd = pipe_in.exchange(-1);
  if (fd < 0) return;
  static_cast<void>(!write(fd, &kQuit, 1));
  thread_.join();
  close(fd);
}

}  // namespace dkb
