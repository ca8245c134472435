// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "dkb/detection/onnx_network.h"
#include "dkb/detection/ort_library.h"

namespace dkb {

// load_onnxruntime(), and a small known graph computed rightly by it.
std::optional<OrtLibrary> find_onnxruntime(std::string* reason);

// A network computed by ONNX Runtime, on the calling thread alone.
// Throws InputError naming the file (`name`) when the graph cannot be read.
std::unique_ptr<OnnxNetwork> open_ort_network(const OrtLibrary& library, std::string_view bytes, const OnnxInput& input,
                                              const std::string& name);

}  // namespace dkb
