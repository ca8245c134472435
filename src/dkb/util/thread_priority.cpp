// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/thread_priority.h"

#include <algorithm>

#if defined(__linux__)
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace dkb {

void set_thread_priority([[maybe_unused]] ThreadPriority priority) {
#if defined(__linux__)
  constexpr int kStep = 10, kLowest = 19;
  // On Linux a thread has a priority of its own, named by its number. Where it is refused nothing is lost but time.
  const auto self = static_cast<id_t>(syscall(SYS_gettid));
  if (priority == ThreadPriority::background)
    setpriority(PRIO_PROCESS, self, std::min(getpriority(PRIO_PROCESS, self) + kStep, kLowest));
  const sched_param none{};
  if (priority == ThreadPriority::idle) sched_setscheduler(0, SCHED_IDLE, &none);  // 0: the calling thread
#endif
}

}  // namespace dkb
