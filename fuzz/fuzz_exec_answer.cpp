// SPDX-License-Identifier: Apache-2.0
// Answers of a detector in a process of its own, of which the input may hold several.
#include <cstdint>
#include <string_view>

#include "dkb/detection/exec_answer.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  for (int64_t number = 0; size_t length = dkb::exec_answer_size(text); ++number) {
    try {
      dkb::parse_exec_answer(text.substr(0, length), number, 64, 48);
    } catch (const dkb::InputError&) {
    }
    text.remove_prefix(length);
  }
  return 0;
}
