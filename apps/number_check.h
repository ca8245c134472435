// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <limits>
#include <string>

namespace dkb {

// Whole numbers are decimal ("010" is ten, where CLI11 would read eight), and one out of range is refused, where CLI11
// would take the largest or, for -1 of an unsigned one, the largest too. To be given to transform().
template <class Whole>
CLI::Validator whole_number(Whole least = std::numeric_limits<Whole>::min(),
                            Whole most = std::numeric_limits<Whole>::max()) {
  const std::string range = std::to_string(least) + " ... " + std::to_string(most);
  const auto read = [=](std::string& text) -> std::string {
    Whole value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size() || value < least || value > most)
      return "\"" + text + "\" is not a whole number of " + range;
    text = std::to_string(value);
    return "";
  };
  const bool limited = least > std::numeric_limits<Whole>::min() || most < std::numeric_limits<Whole>::max();
  return {read, limited ? "in [" + range + "]" : "", ""};
}

}  // namespace dkb
