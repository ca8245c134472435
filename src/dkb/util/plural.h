// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dkb {

// "1 pose", "12 poses": for sentences that people read.
template <class Number>
std::string plural(Number n, const std::string& one, const std::string& more) {
  return std::to_string(n) + " " + (n == 1 ? one : more);
}

}  // namespace dkb
