// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/detection/onnx_module.h"

namespace dkb {

// An ONNX graph ready to run on the CPU, by the module that holds OpenCV's DNN, which is loaded on first use.
class OnnxNetwork {
 public:
  struct Output {
    std::vector<int> dims;
    std::span<const float> values;  // valid until the next forward()
  };

  // Throws InputError naming the file (`name`) when the graph cannot be parsed, or this build has no DNN.
  OnnxNetwork(std::string_view bytes, std::string name);
  ~OnnxNetwork();
  OnnxNetwork(const OnnxNetwork&) = delete;
  OnnxNetwork& operator=(const OnnxNetwork&) = delete;

  // `blob`: 1 x 3 x height x width. Throws InputError naming the file and the layer that fails.
  std::vector<Output> forward(const std::vector<float>& blob, int width, int height);

  // Whether the module is there and loads.
  static bool available();

 private:
  const std::string name_;
  const DkbOnnxApi* api_ = nullptr;
  void* network_ = nullptr;
};

}  // namespace dkb
