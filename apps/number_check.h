// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dkb {

// For unsigned numbers, of which CLI11 would take -1 for the largest.
inline CLI::Validator not_negative() {
  return {[](std::string& text) { return text.starts_with('-') ? text + " is negative" : std::string(); }, "", ""};
}

}  // namespace dkb
