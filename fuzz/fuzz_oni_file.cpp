// SPDX-License-Identifier: Apache-2.0
// Recordings of OpenNI 2, every image of them.
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "dkb/dataset/image_codecs.h"
#include "dkb/devices/oni_file.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("dkb_fuzz_" + std::to_string(getpid()) + ".oni");
  dkb::write_image_file(path, {reinterpret_cast<const char*>(data), size});
  dkb::SourceOptions options;
  options.fallback_camera.emplace();
  options.fallback_camera->width = 320, options.fallback_camera->height = 240;  // the dummy driver's
  try {
    const auto source = dkb::open_oni_file(path, options);
    while (source->next().state != dkb::SourceState::ended) {
    }
  } catch (const dkb::InputError&) {
  }
  std::filesystem::remove(path);
  return 0;
}
