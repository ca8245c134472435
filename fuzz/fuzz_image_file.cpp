// SPDX-License-Identifier: Apache-2.0
// Pictures and depth images: PNG, JPEG and the others that are read.
#include <cstdint>
#include <string_view>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    const dkb::ImageHeader header = dkb::read_image_header(bytes, "image");
    if (static_cast<int64_t>(header.width) * header.height > 1 << 22) return 0;  // large ones only take long
    dkb::decode_picture(bytes, "image");
  } catch (const dkb::InputError&) {
  }
  try {
    dkb::decode_depth(bytes, "image", dkb::Camera::named("fr1"));
  } catch (const dkb::InputError&) {
  }
  return 0;
}
