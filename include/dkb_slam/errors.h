// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the library throws. No other exception leaves it, but for std::bad_alloc.
#pragma once

#include <stdexcept>
#include <string>

#include "dkb_slam/version.h"

namespace dkb {

/// Bad input, bad usage, or an output that cannot be written. what() is one line that says where, what is wrong and
/// what to do, e.g. `rgb.txt:120: timestamp 17.1 is not after the line before it (17.2); sort the file by time`.
/// What fails in a worker thread is thrown by the next call, as an InputError that names the stage.
class DKB_SLAM_API InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An option outside its range. what() names its whole key ("features.count"), its value and its range.
class DKB_SLAM_API InvalidOption : public InputError {
 public:
  InvalidOption(const std::string& key, const std::string& value, const std::string& range)
      : InputError(key + ": " + value + " is out of range; it must be " + range) {}
};

}  // namespace dkb
