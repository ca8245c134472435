// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"

namespace dkb::bench {

std::string Ended::failure(const std::string& error_output) const {
  std::string last;
  std::istringstream lines(error_output);
  for (std::string line; std::getline(lines, line);)
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
  last = one_line(last);
  if (last.starts_with("error: ")) last.erase(0, 7);
  if (last.size() > 300) {
    last.resize(300);
    last += "...";
  }
  if (signal != 0) {
    const char* name = strsignal(signal);
    return "crashed: signal " + std::to_string(signal) + (name != nullptr ? std::string(" (") + name + ")" : "") +
           (last.empty() ? "" : "; last line: " + last);
  }
  return last.empty() ? "exit code " + std::to_string(exit_code) : last;
}

ChildProcess::ChildProcess(const std::vector<std::string>& words, const std::filesystem::path& error_output) {
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& w : copies) argv.push_back(w.data());
  argv.push_back(nullptr);
  const int err = open(error_output.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0644);
  const int null = open("/dev/null", O_RDWR | O_CLOEXEC);
  const pid_t parent = getpid();
  pid_ = err < 0 || null < 0 ? -1 : fork();
  if (pid_ == 0) {  // only calls that are safe after fork
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);
    dup2(null, STDIN_FILENO);
    dup2(null, STDOUT_FILENO);
    dup2(err, STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  const std::string reason = std::strerror(errno);
  if (pid_ > 0) setpgid(pid_, pid_);  // as the child does: whoever comes first
  if (err >= 0) close(err);
  if (null >= 0) close(null);
  if (pid_ < 0) throw OutputError(error_output.string() + ": a run cannot be started (" + reason + ")");
}

ChildProcess::~ChildProcess() {
  kill();
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept : pid_(std::exchange(other.pid_, -1)) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  std::swap(pid_, other.pid_);
  return *this;
}

bool ChildProcess::ended(Ended* how) {
  int status = 0;
  if (pid_ < 0 || waitpid(pid_, &status, WNOHANG) != pid_) return false;
  pid_ = -1;
  if (WIFSIGNALED(status))
    *how = {-1, WTERMSIG(status)};
  else
    *how = {WEXITSTATUS(status), 0};
  return true;
}

void ChildProcess::kill() {
  if (pid_ < 0) return;
  ::kill(-pid_, SIGKILL);  // with whatever it started
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
}

}  // namespace dkb::bench
