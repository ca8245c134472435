// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/piped_command.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

#include "dkb/detection/detection.h"
#include "dkb/util/errors.h"

extern char** environ;

namespace dkb {
namespace {

constexpr std::chrono::seconds kTimeToEnd(2);

void close_if_open(int& fd) {
  if (fd >= 0) close(fd);
  fd = -1;
}

// The shell with `input` and `output` as its standard ones. Returns an error of errno.
int spawn_shell(const std::string& command, int input, int output, pid_t* pid) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&files, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
  // A group of its own, so that Ctrl-C is ours alone, and whatever it starts can be ended with it. Signals as usual,
  // whatever this thread blocks.
  sigset_t none, usual;
  sigemptyset(&none);
  sigemptyset(&usual);
  for (const int signal : {SIGPIPE, SIGINT, SIGTERM, SIGCHLD}) sigaddset(&usual, signal);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &usual);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::string shell = "sh", option = "-c", text = command;
  char* const words[] = {shell.data(), option.data(), text.data(), nullptr};
  const int error = posix_spawn(pid, "/bin/sh", &files, &attributes, words, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  return error;
}

// How it ended by its status of waitpid(); empty when it was SIGKILL, ours.
std::string end_of(int status) {
  if (WIFEXITED(status)) return "exit status " + std::to_string(WEXITSTATUS(status));
  return WTERMSIG(status) == SIGKILL ? "" : "signal " + std::to_string(WTERMSIG(status));
}

// Why a shell could start nothing, by its exit status (POSIX, Shell Command Language, 2.8.2); empty for all else.
std::string why_not_started(int status) {
  if (!WIFEXITED(status)) return "";
  if (WEXITSTATUS(status) == 127) return "exit status 127: the shell finds no such command";
  if (WEXITSTATUS(status) == 126) return "exit status 126: the shell may not execute it";
  return "";
}

}  // namespace

PipedCommand::PipedCommand(const std::string& command) {
  // Its input is a socket because a write to one can be kept from raising SIGPIPE, without a change to the signals of
  // the whole program.
  int input[2] = {-1, -1}, output[2] = {-1, -1};
  int error = 0;
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, input) != 0 || pipe2(output, O_CLOEXEC) != 0) error = errno;
  if (error == 0) error = spawn_shell(command, input[1], output[1], &pid_);
  close_if_open(input[1]);
  close_if_open(output[1]);
  input_ = input[0], output_ = output[0];
  if (error == 0) return;
  close_if_open(input_);
  close_if_open(output_);
  throw InputError("\"" + command + "\" cannot be started (" + std::strerror(error) + ")");
}

PipedCommand::~PipedCommand() {
  close_if_open(input_);
  const Clock::time_point due = Clock::now() + kTimeToEnd;
  while (pid_ >= 0 && wait(false, due) && receive()) received_.clear();
  kill();
  close_if_open(output_);
}

bool PipedCommand::wait(bool to_send, Clock::time_point due) {
  pollfd ends[2] = {{output_, POLLIN, 0}, {to_send ? input_ : -1, POLLOUT, 0}};
  int ready = 0;
  do {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - Clock::now()).count();
    if (left <= 0) return false;
    ready = poll(ends, 2, static_cast<int>(std::min<int64_t>(left, 1 << 30)));
  } while (ready < 0 && errno == EINTR);
  gives_ = ends[0].revents != 0, takes_ = ends[1].revents != 0;
  return ready > 0;
}

size_t PipedCommand::send(std::string_view bytes) {
  const ssize_t n = ::send(input_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (n >= 0) return static_cast<size_t>(n);
  if (errno == EAGAIN || errno == EINTR) return 0;
  close_if_open(input_);  // it reads no more; its output tells why
  return bytes.size();
}

bool PipedCommand::receive() {
  char bytes[1 << 16];
  const ssize_t n = read(output_, bytes, sizeof bytes);
  if (n > 0) received_.append(bytes, static_cast<size_t>(n)), spoke_ = true;
  return n > 0 || (n < 0 && errno == EINTR);
}

int PipedCommand::kill() {
  if (pid_ < 0) return SIGKILL;
  ::kill(-pid_, SIGKILL);
  int status = 0;
  pid_t waited = 0;
  do waited = waitpid(pid_, &status, 0);
  while (waited < 0 && errno == EINTR);
  pid_ = -1;
  return waited < 0 ? SIGKILL : status;  // the program may let the system reap its children
}

std::string PipedCommand::ask(std::string_view request, const std::function<size_t(std::string_view)>& size_of,
                              size_t max_bytes, std::chrono::milliseconds patience) {
  const Clock::time_point due = Clock::now() + patience;
  if (pid_ < 0) throw InputError("it has ended");
  while (true) {
    if (request.empty()) {
      if (const size_t size = size_of(received_); size > 0) {
        std::string answer = received_.substr(0, size);
        received_.erase(0, size);
        return answer;
      }
    }
    if (received_.size() > max_bytes) {
      kill();
      throw InputError("it answered more than " + std::to_string(max_bytes) + " bytes; it was ended");
    }
    if (!wait(!request.empty(), due)) {
      kill();
      throw InputError("it gave no answer within " +
                       fmt::format("{:g}", std::chrono::duration<double>(patience).count()) + " s; it was ended");
    }
    if (takes_) request.remove_prefix(send(request));
    if (gives_ && !receive()) {
      const int status = kill();
      if (const std::string why = why_not_started(status); !why.empty() && !spoke_) throw NeverStarted(why);
      const std::string how = end_of(status);
      throw CommandEnded("ended" + (how.empty() ? "" : " (" + how + ")"));
    }
  }
}

}  // namespace dkb
