// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/ort_network.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <utility>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {

constexpr int kFatal = 4, kAllOptimisations = 99;  // ORT_LOGGING_LEVEL_FATAL, ORT_ENABLE_ALL of its C interface

// An object of ONNX Runtime, with what gives it back.
template <class T>
using Held = std::unique_ptr<T, void (*)(T*)>;

class OrtNetwork final : public OnnxNetwork {
 public:
  OrtNetwork(const OrtLibrary& library, std::string_view bytes, const OnnxInput& input, const std::string& name)
      : ort_(library), name_(name), input_(input.name), size_input_(input.size_name) {
    const std::string what = "read the graph";
    const auto options = make(ort_.release_options, what, ort_.create_options);
    check(ort_.set_threads_within(options.get(), 1), what);
    check(ort_.set_threads_between(options.get(), 1), what);
    check(ort_.set_entry(options.get(), "session.intra_op.allow_spinning", "0"), what);
    check(ort_.set_entry(options.get(), "session.inter_op.allow_spinning", "0"), what);
    check(ort_.disable_memory_pattern(options.get()), what);
    check(ort_.set_optimisation(options.get(), kAllOptimisations), what);
    session_ = make(ort_.release_session, what, ort_.create_session, environment_.get(), bytes.data(), bytes.size(),
                    options.get());
#ifdef __GLIBC__
    malloc_trim(0);  // what reading the graph took goes back: 5 to 15 MB
#endif
    size_t count = 0;
    check(ort_.output_count(session_.get(), &count), what);
    OrtAllocator* allocator = nullptr;
    check(ort_.default_allocator(&allocator), what);
    for (size_t i = 0; i < count; ++i) {
      char* text = nullptr;
      check(ort_.output_name(session_.get(), i, allocator, &text), what);
      outputs_.emplace_back(text);
      check(ort_.free(allocator, text), what);
    }
  }

  std::vector<Output> forward(const std::vector<float>& blob, int width, int height) override {
    const std::string what = "run the graph at " + std::to_string(width) + " x " + std::to_string(height) + " px";
    const int64_t dims[] = {1, 3, height, width}, size_dims[] = {1, 2};
    const auto image = make(ort_.release_value, what, ort_.create_tensor, memory_.get(),
                            static_cast<void*>(const_cast<float*>(blob.data())), blob.size() * sizeof(float), dims,
                            std::size(dims), kOnnxFloat);
    int64_t size[] = {width, height};
    const auto size_value = make(ort_.release_value, what, ort_.create_tensor, memory_.get(), static_cast<void*>(size),
                                 sizeof size, size_dims, std::size(size_dims), kOnnxInt64);
    const char* const inputs[] = {input_.c_str(), size_input_.c_str()};
    const OrtValue* const input_values[] = {image.get(), size_value.get()};
    std::vector<const char*> names;
    for (const std::string& output : outputs_) names.push_back(output.c_str());
    std::vector<OrtValue*> values(names.size(), nullptr);
    values_.clear();
    OrtStatus* status = ort_.run(session_.get(), nullptr, inputs, input_values, size_input_.empty() ? 1 : 2,
                                 names.data(), names.size(), values.data());
    for (OrtValue* value : values) values_.emplace_back(value, ort_.release_value);
    check(status, what);
    std::vector<Output> outputs;
    integers_.clear();
    for (size_t i = 0; i < values_.size(); ++i) append_numbers(values_[i].get(), outputs_[i], what, &outputs);
    return outputs;
  }

  Inference inference() const override {
    return Inference::onnxruntime;
  }

 private:
  void check(OrtStatus* status, const std::string& what) const {
    if (status == nullptr) return;
    const std::string reason = excerpt(ort_.error_message(status));
    ort_.release_status(status);
    throw InputError(name_ + ": ONNX Runtime cannot " + what + " (" + reason +
                     "); export it with opset 12, 32-bit floats and without NMS, or try --inference opencv");
  }

  // What `create` makes of `arguments`.
  template <class T, class Create, class... Arguments>
  Held<T> make(void (*release)(T*), const std::string& what, Create create, Arguments... arguments) const {
    T* made = nullptr;
    check(create(arguments..., &made), what);
    return {made, release};
  }

  // Of a tensor of floats, or of integers as floats.
  void append_numbers(OrtValue* value, const std::string& output, const std::string& what,
                      std::vector<Output>* outputs) {
    int is_tensor = 0, type = 0;
    if (value == nullptr) return;
    check(ort_.is_tensor(value, &is_tensor), what);
    if (is_tensor == 0) return;
    const auto shape = make(ort_.release_shape, what, ort_.shape_of, static_cast<const OrtValue*>(value));
    check(ort_.element_type(shape.get(), &type), what);
    if (type != kOnnxFloat && type != kOnnxInt64) return;
    size_t rank = 0, size = 1;
    check(ort_.rank(shape.get(), &rank), what);
    std::vector<int64_t> dims(rank);
    check(ort_.dimensions(shape.get(), dims.data(), rank), what);
    for (const int64_t d : dims) size *= static_cast<size_t>(d);
    void* data = nullptr;
    check(ort_.tensor_data(value, &data), what);
    const float* floats = static_cast<const float*>(data);
    if (type == kOnnxInt64) {
      const auto* integers = static_cast<const int64_t*>(data);
      integers_.emplace_back(integers, integers + size);
      floats = integers_.back().data();
    }
    outputs->push_back({output, {dims.begin(), dims.end()}, {floats, size}});
  }

  const OrtLibrary ort_;
  const std::string name_, input_, size_input_;
  std::vector<std::string> outputs_;
  // In this order: what comes later uses what comes before.
  const Held<OrtEnvironment> environment_ =
      make(ort_.release_environment, "start", ort_.create_environment, kFatal, "dkb");
  const Held<OrtMemory> memory_ = make(ort_.release_memory, "start", ort_.create_cpu_memory, 0, 0);
  Held<OrtSession> session_{nullptr, ort_.release_session};
  std::vector<Held<OrtValue>> values_;        // of the last image
  std::vector<std::vector<float>> integers_;  // those among them, as floats
};

// A part of a protobuf message that is shorter than 128 bytes.
std::string message_part(int field, const std::string& content) {
  return std::string{static_cast<char>(field << 3 | 2), static_cast<char>(content.size())} + content;
}
std::string number_part(int field, int value) {
  return {static_cast<char>(field << 3), static_cast<char>(value)};
}

// An ONNX file: y = x + x, of 1 x 3 x 2 x 1 floats. Field numbers: onnx.proto.
std::string doubling_graph() {
  const auto tensor = [](int field, const char* name) {
    std::string dims;
    for (const int size : {1, 3, 2, 1}) dims += message_part(1, number_part(1, size));
    return message_part(field, message_part(1, name) + message_part(2, message_part(1, number_part(1, kOnnxFloat) +
                                                                                           message_part(2, dims))));
  };
  const std::string node =
      message_part(1, message_part(1, "x") + message_part(1, "x") + message_part(2, "y") + message_part(4, "Add"));
  const std::string graph = node + message_part(2, "known") + tensor(11, "x") + tensor(12, "y");
  return number_part(1, 7) + message_part(7, graph) +
         message_part(8, number_part(2, 12));  // of IR version 7 and operator set 12
}

// What the library answers to the known graph proves the places of the functions. One that throws is told as `reason`.
bool computes_rightly(const OrtLibrary& library, std::string* reason) {
  try {
    OrtNetwork network(library, doubling_graph(), {"x"}, library.name);
    const std::vector<OnnxNetwork::Output> outputs = network.forward({1, -2, 3, 0.5f, 0, 1e6f}, 1, 2);
    const std::vector<float> expected = {2, -4, 6, 1, 0, 2e6f};
    if (outputs.size() == 1 && outputs[0].dims == std::vector{1, 3, 2, 1} &&
        std::equal(expected.begin(), expected.end(), outputs[0].values.begin(), outputs[0].values.end()))
      return true;
    *reason = library.name + " computes a known graph wrongly";
  } catch (const InputError& e) {
    *reason = e.what();
  }
  return false;
}

}  // namespace

std::optional<OrtLibrary> find_onnxruntime(std::string* reason) {
  auto library = load_onnxruntime(reason);
  if (library && !computes_rightly(*library, reason)) return std::nullopt;
  return library;
}

std::unique_ptr<OnnxNetwork> open_ort_network(const OrtLibrary& library, std::string_view bytes, const OnnxInput& input,
                                              const std::string& name) {
  return std::make_unique<OrtNetwork>(library, bytes, input, name);
}

}  // namespace dkb
