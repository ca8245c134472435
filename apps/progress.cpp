// SPDX-License-Identifier: Apache-2.0
#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "terminal.h"

namespace dkb {

Progress::Progress(std::optional<size_t> total, bool quiet)
    : total_(total), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

void Progress::frame(size_t done, const FrameResult* result) {
  if (quiet_) return;
  const double ms = watch_.ms();
  if (done != total_ && ms - last_ms_ < (terminal_ ? 100 : 5000)) return;
  last_ms_ = ms;
  const double rate = ms > 0 ? 1000.0 * static_cast<double>(done) / ms : 0;
  std::string line = fmt::format("frame {}", done);
  if (total_) line += fmt::format("/{}", std::max(*total_, done));
  line += fmt::format("  {:.0f} frames/s", rate);
  if (total_ && rate > 0)
    line += fmt::format("  ETA {:.0f} s", static_cast<double>(*total_ - std::min(*total_, done)) / rate);
  if (result != nullptr) line += fmt::format("  {} {} inliers", name_of(result->state), result->inliers);
  if (terminal_)
    tell(stderr, "\r\033[K{}", line);
  else
    tell(stderr, "{}\n", line);
  std::fflush(stderr);
  open_line_ = terminal_;
}

void Progress::finish() {
  if (open_line_) tell(stderr, "\n");
  open_line_ = false;
}

}  // namespace dkb
