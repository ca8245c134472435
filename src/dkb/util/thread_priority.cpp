// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/thread_priority.h"

#if defined(__linux__)
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace dkb {

void set_thread_priority([[maybe_unused]] ThreadPriority priority) {
#if defined(__linux__)
  constexpr int kBackground = 10;  // of 0 ... 19
  // On Linux a thread has a priority of its own, named by its number. Where it is refused nothing is lost but time.
  if (priority == ThreadPriority::background)
    setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kBackground);
#endif
}

}  // namespace dkb
