// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"

namespace dkb {

// For catch blocks: what the exception that is being handled says, in one line.
inline std::string what_was_thrown() {
  try {
    throw;
  } catch (const std::exception& e) {
    return one_line(e.what());
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
