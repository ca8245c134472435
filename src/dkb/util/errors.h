// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb_slam/errors.h"

namespace dkb {

// An output that cannot be written, when all input was right: a full disk. The program's exit code is 1 then, not 2.
class OutputError : public InputError {
 public:
  using InputError::InputError;
};

// Throws InvalidOption unless `ok`.
template <class T>
void require_option(bool ok, const char* field, const T& value, const char* range) {
  if (!ok) throw InvalidOption(field, std::to_string(value), range);
}

}  // namespace dkb
