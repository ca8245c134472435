// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace dkb::bench {

// How a child process ended.
struct Ended {
  int exit_code = -1;  // -1: by a signal
  int signal = 0;
  // In words, for a table: the last line that it wrote to its error output, or the signal's name.
  std::string failure(const std::string& error_output) const;
};

// A program started with its error output in a file and the rest away. It dies with this process, and the terminal's
// signals do not reach it.
class ChildProcess {
 public:
  // Throws OutputError when it cannot be started or the file cannot be made.
  ChildProcess(const std::vector<std::string>& words, const std::filesystem::path& error_output);
  ~ChildProcess();  // killed if it still runs
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;

  bool ended(Ended* how);  // never waits; `how` is set once it returns true
  void kill();             // at once, and waits for it

 private:
  pid_t pid_ = -1;  // -1: nothing to wait for
};

}  // namespace dkb::bench
