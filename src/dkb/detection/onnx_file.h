// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace dkb {

// Types of numbers: TensorProto.DataType of onnx.proto, which ONNX Runtime numbers alike.
inline constexpr int kOnnxFloat = 1, kOnnxInt64 = 7;

// What the detector must know of an ONNX graph before it runs: the image that goes in (initialisers are no inputs).
struct OnnxInput {
  std::string name;
  int element_type = 0;         // as above
  std::vector<int64_t> dims{};  // -1 = left open by the graph
  // A second input, by which RT-DETR and D-FINE are told the width and height that boxes shall refer to (1 x 2 integers
  // of 64 bits); empty = none.
  std::string size_name{};
};

// Reads an ONNX file's protobuf wire format, as far as the graph's inputs need it, and checks that every message on the
// way is whole. Throws InputError naming the file when the bytes are truncated, are no ONNX model, or have no or other
// inputs. Any bytes are safe.
OnnxInput read_onnx_input(std::string_view bytes, const std::string& name);

}  // namespace dkb
