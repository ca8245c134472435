// SPDX-License-Identifier: Apache-2.0
// What is read of an ONNX file before anything runs it.
#include <cstdint>
#include <string_view>

#include "dkb/detection/onnx_file.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    dkb::read_onnx_input(std::string_view(reinterpret_cast<const char*>(data), size), "m.onnx");
  } catch (const dkb::InputError&) {
  }
  return 0;
}
