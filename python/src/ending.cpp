// SPDX-License-Identifier: Apache-2.0
#include "ending.h"

#include <pthread.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

namespace dkb::python {
namespace {

// [s] that the calls of other threads get at exit. A detector may wait for a thread that has ended already, and then
// for ever. The library waits as long for a detector's first answer.
constexpr auto kPatience = std::chrono::seconds(10);

std::set<Closable*>& open_ones() {  // in no order that anything depends on; touched with the GIL held
  static std::set<Closable*> all;
  return all;
}

// Nobody who holds the mutex waits for the GIL.
struct Ending {
  std::mutex mutex;
  std::condition_variable changed;
  int calls = 0;      // of all threads, in frames of C++
  int returning = 0;  // threads that wait for the GIL
  bool begun = false, over = false;
  std::thread::id by;  // who ends the program
};

// Never destroyed: threads may sleep in it to the end. A process that was forked has none of the threads that are in
// it.
Ending* the_ending = [] {
  ::pthread_atfork(nullptr, nullptr, [] { the_ending = new Ending; });
  return new Ending;
}();
Ending& ending() {
  return *the_ending;
}

// Before the GIL is taken, and after.
void begin_return(Ending& e) {
  std::unique_lock lock(e.mutex);
  if (e.over && e.by != std::this_thread::get_id()) {
    lock.unlock();
    while (true) ::pause();  // there is no Python any more to return to
  }
  ++e.returning;
}
void end_return(Ending& e, int calls) {
  const std::lock_guard lock(e.mutex);
  --e.returning;
  e.calls -= calls;
  e.changed.notify_all();
}

// Until nobody is in a call. Throws what Ctrl-C raises.
void wait_for_calls(Ending& e) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (true) {
    bool quiet = false;
    PyThreadState* thread = PyEval_SaveThread();
    {
      std::unique_lock lock(e.mutex);
      quiet = e.changed.wait_for(lock, std::chrono::milliseconds(50), [&] { return e.calls <= 0; });
    }
    PyEval_RestoreThread(thread);
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (quiet || std::chrono::steady_clock::now() > end) return;
  }
}

// From now on no thread but this one takes the GIL here.
void shut(Ending& e) {
  PyThreadState* thread = PyEval_SaveThread();
  {
    std::unique_lock lock(e.mutex);
    e.over = true;
    e.changed.wait(lock, [&] { return e.returning == 0; });
  }
  PyEval_RestoreThread(thread);
}

}  // namespace

Closable::Closable() : process_(::getpid()) {
  open_ones().insert(this);
}
Closable::~Closable() {
  open_ones().erase(this);
}

bool Closable::made_elsewhere() const {
  return process_ != ::getpid();
}

void Closable::end_all() {
  Ending& e = ending();
  {
    const std::lock_guard lock(e.mutex);
    e.begun = true;
    e.by = std::this_thread::get_id();
  }
  const std::set<Closable*> all = open_ones();
  for (Closable* one : all)
    if (open_ones().contains(one)) one->close();
  try {
    wait_for_calls(e);
  } catch (...) {
    shut(e);
    throw;
  }
  shut(e);
}

void refuse_at_end() {
  Ending& e = ending();
  {
    const std::lock_guard lock(e.mutex);
    if (!e.begun || e.by == std::this_thread::get_id()) return;
  }
  PyErr_SetString(PyExc_SystemExit, "the program ends");
  throw py::error_already_set();
}

Unlocked::Unlocked(Entry entry) {
  if (entry == Entry::may_be_refused) refuse_at_end();
  {
    const std::lock_guard lock(ending().mutex);
    ++ending().calls;
  }
  thread_ = PyEval_SaveThread();
}
Unlocked::~Unlocked() {
  Ending& e = ending();
  begin_return(e);
  PyEval_RestoreThread(thread_);
  end_return(e, 1);
}

Locked::Locked() {
  if (PyGILState_Check() != 0) return;
  Ending& e = ending();
  begin_return(e);
  gil_.emplace();
  end_return(e, 0);
}

InPython::InPython() {
  const std::lock_guard lock(ending().mutex);
  ++ending().calls;
}
InPython::~InPython() {
  const std::lock_guard lock(ending().mutex);
  --ending().calls;
  ending().changed.notify_all();
}

}  // namespace dkb::python
