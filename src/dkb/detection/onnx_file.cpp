// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_file.h"

#include <algorithm>
#include <functional>
#include <set>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr const char* kSizeInput = "orig_target_sizes";  // as RT-DETR and D-FINE export it

// One field of a protobuf message (protobuf encoding guide; groups, which ONNX never uses, are refused).
struct Field {
  uint64_t number = 0;
  uint64_t varint = 0;       // wire type 0
  std::string_view message;  // wire type 2
  bool is_message = false;
};

class Wire {
 public:
  explicit Wire(const std::string& name) : name_(name) {}

  [[noreturn]] void fail(const char* what) const {
    throw InputError(name_ + ": is truncated or no ONNX model (" + what + "); download or export it again");
  }

  void each_field(std::string_view message, const std::function<void(const Field&)>& use) const {
    while (!message.empty()) {
      const uint64_t tag = varint(&message);
      Field field;
      field.number = tag >> 3;
      if (field.number == 0 || field.number > 0x1FFFFFFF) fail("a field has an impossible number");
      switch (tag & 7) {
        case 0:
          field.varint = varint(&message);
          break;
        case 1:
          take(&message, 8);
          break;
        case 2:
          field.message = take(&message, varint(&message));
          field.is_message = true;
          break;
        case 5:
          take(&message, 4);
          break;
        default:
          fail("a field has an impossible type");
      }
      use(field);
    }
  }

 private:
  uint64_t varint(std::string_view* rest) const {
    uint64_t value = 0;
    for (int shift = 0; shift < 70; shift += 7) {
      if (rest->empty()) fail("it ends within a number");
      const auto byte = static_cast<uint8_t>(rest->front());
      rest->remove_prefix(1);
      if (shift < 64) value |= static_cast<uint64_t>(byte & 0x7F) << shift;
      if (byte < 0x80) return value;
    }
    fail("a number is too long");
  }
  std::string_view take(std::string_view* rest, uint64_t size) const {
    if (size > rest->size()) fail("a part is longer than what is there");
    const std::string_view taken = rest->substr(0, size);
    rest->remove_prefix(size);
    return taken;
  }

  const std::string& name_;
};

// ValueInfoProto: name = 1, type = 2 {tensor_type = 1 {elem_type = 1, shape = 2 {dim = 1 {dim_value = 1}}}}.
OnnxInput read_value_info(const Wire& wire, std::string_view message) {
  OnnxInput input;
  const auto read_shape = [&](const Field& shape) {
    if (shape.number != 1 || !shape.is_message) return;
    int64_t size = -1;
    wire.each_field(shape.message, [&](const Field& f) {
      if (f.number == 1 && !f.is_message && f.varint > 0 && f.varint <= INT32_MAX)
        size = static_cast<int64_t>(f.varint);
    });
    input.dims.push_back(size);
  };
  const auto read_tensor = [&](const Field& f) {
    if (f.number == 1 && !f.is_message) input.element_type = static_cast<int>(std::min<uint64_t>(f.varint, 1000));
    if (f.number == 2 && f.is_message) wire.each_field(f.message, read_shape);
  };
  wire.each_field(message, [&](const Field& f) {
    if (f.number == 1 && f.is_message) input.name = std::string(f.message);
    if (f.number == 2 && f.is_message)
      wire.each_field(f.message, [&](const Field& type) {
        if (type.number == 1 && type.is_message) wire.each_field(type.message, read_tensor);
      });
  });
  return input;
}

}  // namespace

OnnxInput read_onnx_input(std::string_view bytes, const std::string& name) {
  const Wire wire(name);
  std::vector<OnnxInput> inputs;
  std::set<std::string> initialisers;
  size_t nodes = 0;
  bool elsewhere = false;  // weights in a file beside it, which nobody moves or checks with the model
  // GraphProto: node = 1 {attribute = 5}, initializer = 5 {name = 8, data_location = 14}, input = 11.
  const auto read_graph = [&](const Field& f) {
    if (!f.is_message) return;
    if (f.number == 1) {
      ++nodes;
      wire.each_field(f.message, [&](const Field& node) {
        if (node.number == 5 && node.is_message) wire.each_field(node.message, [](const Field&) {});
      });
    } else if (f.number == 5) {
      wire.each_field(f.message, [&](const Field& tensor) {
        if (tensor.number == 8 && tensor.is_message) initialisers.emplace(tensor.message);
        elsewhere |= tensor.number == 14 && !tensor.is_message && tensor.varint == 1;
      });
    } else if (f.number == 11) {
      inputs.push_back(read_value_info(wire, f.message));
    }
  };
  if (bytes.empty()) throw InputError(name + ": is empty; download or export the model again");
  bool versioned = false;  // ModelProto: ir_version = 1, graph = 7
  wire.each_field(bytes, [&](const Field& f) {
    versioned |= f.number == 1 && !f.is_message;
    if (f.number == 7 && f.is_message) wire.each_field(f.message, read_graph);
  });
  if (!versioned || nodes == 0) wire.fail("it holds no graph");
  if (elsewhere)
    throw InputError(name +
                     ": its weights lie in another file; export it as one file (external_data=False, or "
                     "onnx.save of the loaded model)");
  std::erase_if(inputs, [&](const OnnxInput& input) { return initialisers.count(input.name) != 0; });
  const auto size = std::find_if(inputs.begin(), inputs.end(), [](const OnnxInput& input) {
    return input.name == kSizeInput && input.element_type == kOnnxInt64;
  });
  std::string size_name;
  if (size != inputs.end()) {
    size_name = size->name;
    inputs.erase(size);
  }
  if (inputs.size() != 1)
    throw InputError(name + ": the graph has " + std::to_string(inputs.size()) +
                     " inputs; a detector has one, the image, and perhaps " + kSizeInput +
                     "; export the model as docs/models.md says");
  inputs.front().size_name = std::move(size_name);
  return std::move(inputs.front());
}

}  // namespace dkb
