// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dkb {

// `text` with a space for each control character: a message stays one line long, whatever it quotes.
inline std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  return text;
}

}  // namespace dkb
