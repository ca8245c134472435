// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/detection/onnx_file.h"

namespace dkb {

// What computes a network. `automatic`: ONNX Runtime where its library is found, else OpenCV.
enum class Inference { automatic, onnxruntime, opencv };
const char* to_string(Inference inference);  // "auto", "onnxruntime", "opencv"
// Throws InputError naming --inference and the known names.
Inference inference_named(const std::string& name);

// An ONNX graph ready to run on one core of the CPU.
class OnnxNetwork {
 public:
  struct Output {
    std::string name;  // empty by OpenCV, which does not tell it
    std::vector<int> dims;
    std::span<const float> values;  // valid until the next forward()
  };

  virtual ~OnnxNetwork() = default;
  // The tensors of floats and integers that the graph puts out for `blob`: 1 x 3 x height x width. Throws InputError
  // naming the file and what fails.
  virtual std::vector<Output> forward(const std::vector<float>& blob, int width, int height) = 0;
  virtual Inference inference() const = 0;  // never `automatic`
};

// `bytes`: of the ONNX file `name` with this input. Throws InputError naming the file when the graph cannot be read;
// when what is to compute it is not here, with how to get it.
std::unique_ptr<OnnxNetwork> open_network(Inference inference, std::string_view bytes, const OnnxInput& input,
                                          const std::string& name);

// Whether open_network() would find what is to compute a network.
bool available(Inference inference);

}  // namespace dkb
