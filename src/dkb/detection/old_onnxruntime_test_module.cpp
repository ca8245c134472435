// SPDX-License-Identifier: Apache-2.0
// For tests: takes ONNX Runtime's place as a library of a version that is too old.
#include <cstdint>

namespace {

struct Base {
  const void* (*interface)(uint32_t);
  const char* (*version)();
};
const Base kBase = {[](uint32_t) -> const void* { return nullptr; }, [] { return "1.9.1"; }};

}  // namespace

extern "C" __attribute__((visibility("default"))) const Base* OrtGetApiBase() {
  return &kBase;
}
