// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace dkb {

// Prints like fmt::print, but throws nothing where `to` is closed or full: no result is lost by it. main() looks at
// standard output at the end.
template <class... Values>
void tell(std::FILE* to, fmt::format_string<Values...> format, Values&&... values) {
  const std::string text = fmt::format(format, std::forward<Values>(values)...);
  static_cast<void>(std::fwrite(text.data(), 1, text.size(), to));
}

}  // namespace dkb
