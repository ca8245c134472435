// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

// `background` steps back behind tracking where cores are few. `idle` work is done where nothing else wants the core,
// and what else wakes up takes such a core at once: for work that another thread does when somebody waits for it.
enum class ThreadPriority { normal, background, idle };

// Raising the priority again takes privileges: give it to a thread once, when it starts. In a dataset run no result
// depends on it. Only on Linux, elsewhere nothing happens.
void set_thread_priority(ThreadPriority priority);

}  // namespace dkb
