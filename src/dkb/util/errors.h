// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace dkb {

// Bad input or bad usage: the message is one line that says where, what is wrong and what to do,
// e.g. `rgb.txt:120: timestamp 17.1 is not after the line before it (17.2); sort the file by time`.
// The command line prints it after "error: " and exits with 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// An option outside its range; the message names the field, its value and its range.
class InvalidOption : public InputError {
 public:
  InvalidOption(const std::string& field, const std::string& value, const std::string& range)
      : InputError(field + ": " + value + " is out of range; it must be " + range) {}
};

// An output that cannot be written: unwritable folder, full disk.
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
