// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "dkb/util/random.h"

namespace dkb {

// For tests of parsers: `original` with a few bytes replaced, inserted, removed, repeated or cut off.
inline std::string mutated(const std::string& original, Random& random) {
  static constexpr char kTelling[] = "\0\xFF\x7F\x80 \n\r\t#.,:-+eE0123456789naif{}[]\"'&*!|%@`";
  std::string bytes = original;
  for (uint32_t n = 1 + random.below(5); n > 0 && !bytes.empty(); --n) {
    // Half of the changes go to the beginning, where the headers are.
    const size_t range = random.below(2) == 0 ? std::min<size_t>(bytes.size(), 80) : bytes.size();
    const size_t at = random.below(static_cast<uint32_t>(range));
    const char c = random.below(2) == 0 ? static_cast<char>(random.below(256))
                                        : kTelling[random.below(static_cast<uint32_t>(sizeof kTelling - 1))];
    switch (random.below(6)) {
      case 0:
      case 1:
        bytes[at] = c;
        break;
      case 2:
        bytes.insert(at, 1 + random.below(4), c);
        break;
      case 3:
        bytes.erase(at, 1 + random.below(8));
        break;
      case 4:
        bytes.insert(at, bytes.substr(at, 1 + random.below(40)));
        break;
      default:
        bytes.resize(at + random.below(static_cast<uint32_t>(bytes.size() - at + 1)));
    }
  }
  return bytes;
}

}  // namespace dkb
