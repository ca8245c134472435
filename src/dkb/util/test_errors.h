// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb/util/errors.h"

namespace dkb::test {

// What the InputError that `action()` throws says; "no error" when it throws none.
template <class Action>
std::string input_error_of(const Action& action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace dkb::test
