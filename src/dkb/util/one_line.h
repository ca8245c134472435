// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace dkb {

// `text` with a space in the place of control characters, of several in a row one, and none beside a space or at an
// end: a message stays one line long, whatever it quotes.
inline std::string one_line(std::string_view text) {
  std::string line;
  bool broken = false;
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    if (!control && broken && !line.empty() && line.back() != ' ' && c != ' ') line += ' ';
    if (!control) line += c;
    broken = control;
  }
  return line;
}

// What a message quotes of a file's or a user's `text`: one line, and no more of it than a reader needs.
inline std::string excerpt(std::string_view text) {
  constexpr size_t kLongest = 120;
  std::string out = one_line(text.substr(0, kLongest));
  return text.size() > kLongest ? out + "..." : out;
}

inline std::string in_quotes(std::string_view text) {
  return "\"" + excerpt(text) + "\"";
}

}  // namespace dkb
