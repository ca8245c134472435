// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string>
#include <string_view>

#include "dkb/util/errors.h"

namespace dkb {

// A message of somebody else's as one line, as all of ours are.
inline std::string as_one_line(std::string_view text) {
  constexpr std::string_view kBreaks = "\r\n\t\v\f";
  std::string line;
  bool broken = false;
  for (const char c : text) {
    if (kBreaks.find(c) != std::string_view::npos) {
      broken = true;
      continue;
    }
    if (broken && !line.empty() && line.back() != ' ' && c != ' ') line += ' ';
    broken = false;
    line += c;
  }
  return line;
}

// For catch blocks: what the exception that is being handled says, in one line.
inline std::string what_was_thrown() {
  try {
    throw;
  } catch (const std::exception& e) {
    return as_one_line(e.what());
  } catch (...) {
    return "it threw something that is no exception";
  }
}

// For catch blocks: that exception as it may leave the library. Bad input stays what it is; all else becomes an
// InputError that names what failed.
inline std::exception_ptr as_input_error(const std::string& what_failed) {
  try {
    throw;
  } catch (const InputError&) {
    return std::current_exception();
  } catch (...) {
    return std::make_exception_ptr(InputError(what_failed + " failed: " + what_was_thrown()));
  }
}

}  // namespace dkb
