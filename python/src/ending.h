// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <sys/types.h>

#include <optional>

// How a program ends while its threads are in calls of the library. Once the interpreter goes, it ends every other
// thread that asks for the GIL, by unwinding its stack: through frames of C++ that aborts the program. So the module
// waits at exit until no thread is in such a frame, and lets none enter again.
namespace dkb::python {

namespace py = pybind11;

// Something with threads of its own that must be at rest before Python goes: its threads may wait for the GIL. Objects
// are closed when the interpreter exits, if not before.
class Closable {
 public:
  Closable();
  virtual ~Closable();
  Closable(const Closable&) = delete;
  Closable& operator=(const Closable&) = delete;
  virtual void close() = 0;
  // A process that was forked has a copy of it, whose threads stayed behind: it can neither work nor be closed.
  bool made_elsewhere() const;
  // Closes all, and waits for the calls that other threads are in. Ctrl-C ends the wait. With the GIL, at exit.
  static void end_all();

 private:
  const pid_t process_;
};

// Throws SystemExit, which ends the thread quietly, once the program ends and on any other thread than the one that
// ends it.
void refuse_at_end();

// Whether a refusal to enter may be thrown.
enum class Entry { may_be_refused, always };

// Without the GIL for a while: what the module has in the place of py::gil_scoped_release. Refused as above.
class Unlocked {
 public:
  explicit Unlocked(Entry entry = Entry::may_be_refused);
  ~Unlocked();
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  PyThreadState* thread_;
};

// With the GIL for a while, on a thread that has let go of it or never had it: in the place of py::gil_scoped_acquire.
class Locked {
 public:
  Locked();

 private:
  std::optional<py::gil_scoped_acquire> gil_;
};

// A call into Python from C++ with the GIL, in which other threads may run.
class InPython {
 public:
  InPython();
  ~InPython();
  InPython(const InPython&) = delete;
  InPython& operator=(const InPython&) = delete;
};

}  // namespace dkb::python
