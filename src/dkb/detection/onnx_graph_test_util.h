// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <string>
#include <vector>

// Writes small ONNX graphs by hand, so that the tests need neither weights nor an exporter. Field numbers: onnx.proto.
namespace dkb::onnx_test {

inline std::string varint(uint64_t value) {
  std::string out;
  for (; value >= 128; value >>= 7) out += static_cast<char>((value & 127) | 128);
  return out + static_cast<char>(value);
}
inline std::string number(int field, int64_t value) {
  return varint(static_cast<uint64_t>(field) << 3) + varint(static_cast<uint64_t>(value));
}
inline std::string message(int field, const std::string& content) {
  return varint((static_cast<uint64_t>(field) << 3) | 2) + varint(content.size()) + content;
}

inline std::string attribute(const std::string& name, int64_t value) {
  return message(5, message(1, name) + number(3, value) + number(20, 2));
}
inline std::string attribute(const std::string& name, const std::vector<int64_t>& values) {
  std::string out = message(1, name);
  for (const int64_t v : values) out += number(8, v);
  return message(5, out + number(20, 7));
}

inline std::string node(const std::string& type, const std::vector<std::string>& inputs, const std::string& output,
                        const std::string& attributes = "") {
  std::string out;
  for (const std::string& input : inputs) out += message(1, input);
  return message(1, out + message(2, output) + message(3, "node_" + output) + message(4, type) + attributes);
}

inline std::string tensor(const std::string& name, const std::vector<int64_t>& dims, int type, const std::string& raw) {
  std::string out;
  for (const int64_t d : dims) out += number(1, d);
  return message(5, out + number(2, type) + message(8, name) + message(9, raw));
}
inline std::string tensor(const std::string& name, const std::vector<int64_t>& dims, const std::vector<float>& values) {
  return tensor(name, dims, 1,
                std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)));
}
inline std::string tensor(const std::string& name, const std::vector<int64_t>& values) {
  return tensor(name, {static_cast<int64_t>(values.size())}, 7,
                std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(int64_t)));
}

// `field`: 11 = graph input, 12 = graph output. A dimension of -1 is left open.
inline std::string value_info(int field, const std::string& name, const std::vector<int64_t>& dims, int type = 1) {
  std::string shape;
  for (const int64_t d : dims) shape += message(1, d < 0 ? message(2, "open") : number(1, d));
  return message(field, message(1, name) + message(2, message(1, number(1, type) + message(2, shape))));
}

inline std::string model(const std::string& graph) {
  return number(1, 7) + message(2, "test") + message(7, graph + message(2, "graph")) + message(8, number(2, 12));
}

// A tensor that a graph puts out: value[i] = bias[i] + sum over channels c of slope[c][i] * (mean of channel c).
struct Put {
  std::string name;
  std::vector<int> dims;
  std::vector<float> bias;
  std::array<std::vector<float>, 3> slope{};  // empty = zeros
  bool integers = false;

  Put(const std::string& its_name, const std::vector<int>& its_dims) : name(its_name), dims(its_dims) {
    size_t size = 1;
    for (const int d : dims) size *= static_cast<size_t>(d);
    bias.assign(size, 0.0f);
    slope.fill(bias);
  }
  // The place of a value, and the value there.
  size_t at(std::initializer_list<int> place) const {
    size_t index = 0, axis = 0;
    for (const int p : place) index = index * static_cast<size_t>(dims[axis++]) + static_cast<size_t>(p);
    return index;
  }
  float& operator()(std::initializer_list<int> place) { return bias[at(place)]; }
};

// `more`: further nodes and inputs.
inline std::string put_graph(int width, int height, const std::vector<Put>& outputs, const std::string& more = "") {
  std::string nodes = node("GlobalAveragePool", {"images"}, "means") +
                      node("Flatten", {"means"}, "flat", attribute("axis", int64_t{1}));
  std::string tensors, infos;
  for (const Put& put : outputs) {
    const std::string& name = put.name;
    std::vector<float> matrix;
    for (size_t i = 0; i < put.bias.size(); ++i)
      for (const std::vector<float>& of_channel : put.slope) matrix.push_back(of_channel[i]);
    const auto size = static_cast<int64_t>(put.bias.size());
    const std::vector<int64_t> dims(put.dims.begin(), put.dims.end());
    nodes +=
        node("Gemm", {"flat", name + "_slope", name + "_bias"}, name + "_values", attribute("transB", int64_t{1})) +
        node("Reshape", {name + "_values", name + "_shape"}, put.integers ? name + "_floats" : name);
    if (put.integers) nodes += node("Cast", {name + "_floats"}, name, attribute("to", int64_t{7}));
    tensors += tensor(name + "_slope", {size, 3}, matrix) + tensor(name + "_bias", {size}, put.bias) +
               tensor(name + "_shape", dims);
    infos += value_info(12, name, dims, put.integers ? 7 : 1);
  }
  return model(nodes + tensors + value_info(11, "images", {1, 3, height, width}) + infos + more);
}

// A YOLOX head of any input size whose cells of each stride all say the same: `cell` (5 + classes values) at stride 32,
// nothing at strides 8 and 16.
inline std::string yolox_graph(int width, int height, const std::vector<float>& cell) {
  const auto channels = static_cast<int64_t>(cell.size());
  std::string nodes, tensors = tensor("flat", {1, channels, -1}) +
                               tensor("weight", {channels, 3, 1, 1}, std::vector<float>(cell.size() * 3, 0.0f)) +
                               tensor("bias8", {channels}, std::vector<float>(cell.size(), 0.0f)) +
                               tensor("bias16", {channels}, std::vector<float>(cell.size(), 0.0f)) +
                               tensor("bias32", {channels}, cell);
  std::vector<std::string> parts;
  for (const int stride : {8, 16, 32}) {
    const std::string s = std::to_string(stride);
    nodes += node("Conv", {"images", "weight", "bias" + s}, "conv" + s,
                  attribute("kernel_shape", std::vector<int64_t>{1, 1}) +
                      attribute("strides", std::vector<int64_t>{stride, stride}));
    nodes += node("Reshape", {"conv" + s, "flat"}, "flat" + s);
    parts.push_back("flat" + s);
  }
  nodes += node("Concat", parts, "all", attribute("axis", int64_t{2}));
  nodes += node("Transpose", {"all"}, "output", attribute("perm", std::vector<int64_t>{0, 2, 1}));
  return model(nodes + tensors + value_info(11, "images", {1, 3, height, width}) +
               value_info(12, "output", {1, -1, channels}));
}

}  // namespace dkb::onnx_test
