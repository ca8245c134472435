// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdio>

#include "dkb/util/thrown.h"

namespace dkb {

// For the C interfaces of modules, which no exception may cross: runs `work`; an exception becomes `failure` and a
// text.
template <class Result, class Work>
Result guarded(Result failure, char* error, size_t error_size, const Work& work) {
  try {
    return work();
  } catch (...) {
    std::snprintf(error, error_size, "%s", what_was_thrown().c_str());
  }
  return failure;
}

}  // namespace dkb
