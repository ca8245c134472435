// SPDX-License-Identifier: Apache-2.0
// Bags, mcap files and .db3 files, told apart by their content.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "dkb/recordings/message_stream.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const int file = memfd_create("recording", MFD_CLOEXEC);
  if (file < 0 || write(file, data, size) != static_cast<ssize_t>(size)) return 0;
  try {
    const auto stream = dkb::open_messages("/proc/self/fd/" + std::to_string(file));
    while (stream->next()) {
    }
    stream->select({"/camera/depth/image_raw"});
    stream->rewind();
    while (stream->next()) {
    }
    stream->take_warnings();
  } catch (const dkb::InputError&) {
  }
  close(file);
  return 0;
}
