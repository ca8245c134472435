// SPDX-License-Identifier: Apache-2.0
// Files of recorded sessions.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "dkb/util/errors.h"
#include "dkb/viewer/session_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const int fd = memfd_create("session", MFD_CLOEXEC);
  if (fd < 0 || write(fd, data, size) != static_cast<ssize_t>(size)) return 0;
  try {
    dkb::SessionFile file("/proc/self/fd/" + std::to_string(fd));
    file.update();
    for (const dkb::SessionFile::Entry& entry : file.entries()) file.read(entry.offset, entry.offset + 100);
    if (file.read(0, file.size()).size() != file.size()) __builtin_trap();
  } catch (const dkb::InputError&) {
  }
  close(fd);
  return 0;
}
