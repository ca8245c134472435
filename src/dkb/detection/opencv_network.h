// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "dkb/detection/onnx_module.h"
#include "dkb/detection/onnx_network.h"

namespace dkb {

// The module that holds OpenCV's DNN, loaded on first use. Null when it is not there; `reason` says why in one line.
const DkbOnnxApi* load_opencv_module(std::string* reason);

// A network computed by that module. Throws InputError naming the file (`name`) when the graph cannot be parsed.
std::unique_ptr<OnnxNetwork> open_opencv_network(const DkbOnnxApi& api, std::string_view bytes,
                                                 const std::string& name);

}  // namespace dkb
