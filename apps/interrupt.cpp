// SPDX-License-Identifier: Apache-2.0
#include "interrupt.h"

#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <utility>

namespace dkb {
namespace {

// A handler may do little more than write to a pipe; the thread that reads it does the rest.
std::atomic<bool> interrupted{false};
std::atomic<int> pipe_in{-1};
std::atomic<int64_t> first_ms{0};  // of Ctrl-C; 0 = none yet
constexpr char kInterrupted = 'i', kQuit = 'q';
constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};
// `timeout` and shells send one Ctrl-C to the program and again to its group.
constexpr int64_t kSamePressMs = 300;

int64_t now_ms() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1000000;
}

void on_signal(int signal) {
  const int saved = errno;
  if (signal == SIGINT) {
    const int64_t now = now_ms();
    int64_t first = 0;
    if (!first_ms.compare_exchange_strong(first, now) && now - first > kSamePressMs) {
      std::signal(signal, SIG_DFL);
      std::raise(signal);
    }
  }
  interrupted = true;
  if (const int fd = pipe_in; fd >= 0) static_cast<void>(!write(fd, &kInterrupted, 1));
  errno = saved;
}

}  // namespace

bool Interrupt::happened() {
  return interrupted;
}

void Interrupt::check() {
  if (happened()) throw InterruptedError();
}

Interrupt::Interrupt(std::function<void()> stop) {
  interrupted = false;
  first_ms = 0;
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
  struct sigaction ours {};
  ours.sa_handler = on_signal;
  ours.sa_flags = SA_RESTART;
  sigemptyset(&ours.sa_mask);
  for (size_t i = 0; i < std::size(kSignals); ++i) {
    sigaction(kSignals[i], nullptr, &before_[i]);
    const bool kept = kSignals[i] == SIGHUP && before_[i].sa_handler == SIG_IGN;
    if (!kept) sigaction(kSignals[i], &ours, nullptr);
  }
}

Interrupt::~Interrupt() {
  for (size_t i = 0; i < std::size(kSignals); ++i) sigaction(kSignals[i], &before_[i], nullptr);
  const int fd = pipe_in.exchange(-1);
  if (fd < 0) return;
  static_cast<void>(!write(fd, &kQuit, 1));
  thread_.join();
  close(fd);
}

}  // namespace dkb
