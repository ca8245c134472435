// SPDX-License-Identifier: Apache-2.0
// Maps on disk: the file as it is, and its sections as if their checksums were right.
#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "dkb/map/map_file.h"
#include "dkb/map/map_sections.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t kPreamble = 20, kHeader = 16;  // [bytes] of the file, and of each section
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    dkb::decode_map(bytes, "map.dkb");
  } catch (const dkb::InputError&) {
  }
  std::array<std::string_view, dkb::MapSections::kCount> sections;
  size_t at = kPreamble;
  for (std::string_view& section : sections) {
    if (at + kHeader > size) break;
    uint64_t length = 0;
    std::memcpy(&length, data + at + 4, sizeof length);
    section = bytes.substr(at + kHeader, length);
    at += kHeader + section.size();
  }
  try {
    dkb::read_sections(sections, 3);
  } catch (const dkb::InputError&) {
  }
  return 0;
}
