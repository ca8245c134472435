// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

enum class ThreadPriority { normal, background };

// Background work steps back behind tracking where cores are few. Raising the priority again takes privileges: give it
// to a thread once, when it starts. In a dataset run no result depends on it. Only on Linux, elsewhere nothing happens.
void set_thread_priority(ThreadPriority priority);

}  // namespace dkb
