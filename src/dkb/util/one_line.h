// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace dkb {

// `text` with a space for each control character: a message stays one line long, whatever it quotes.
inline std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = ' ';
  return text;
}

// What a message quotes of a file's or a user's `text`: one line, and no more of it than a reader needs.
inline std::string excerpt(std::string_view text) {
  constexpr size_t kLongest = 120;
  std::string out = one_line(std::string(text.substr(0, kLongest)));
  return text.size() > kLongest ? out + "..." : out;
}

}  // namespace dkb
