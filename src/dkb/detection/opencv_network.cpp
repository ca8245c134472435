// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/opencv_network.h"

#include <algorithm>
#include <array>

#include "dkb/util/errors.h"
#include "dkb/util/module.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {

std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const size_t start = text.find(before);
  if (start == std::string::npos) return {};
  const size_t end = text.find(after, start + before.size());
  return end == std::string::npos ? std::string() : text.substr(start + before.size(), end - start - before.size());
}

// What to do about OpenCV's message, in one line with the layer first where it names one:
// `Node [Gemm@ai.onnx]:(onnx_node!name) parse error: ... error: reason`, or `Can't create layer "..." of type "Gemm"`.
std::string explain_opencv(const std::string& message) {
  const std::string text = one_line(message);
  std::string type = between(text, "Node [", "@"), layer = between(text, "]:(", ")");
  if (type.empty()) type = between(text, "of type \"", "\"");
  if (layer.empty()) layer = between(text, "Can't create layer \"", "\"");
  if (layer.starts_with("onnx_node!")) layer.erase(0, 10);
  std::string reason = text;
  if (const size_t last = text.rfind("error: "); last != std::string::npos) reason = text.substr(last + 7);
  if (const size_t code = reason.find(") "); reason.starts_with("(-") && code != std::string::npos)
    reason.erase(0, code + 2);
  while (!reason.empty() && (reason.back() == ' ' || reason.back() == '>')) reason.pop_back();
  if (reason.size() > 160) reason = reason.substr(0, 160) + "...";
  return (type.empty() ? "" : "at layer " + type + " \"" + layer + "\" ") + "(" + reason +
         "); export it with opset 12, fixed size, 32-bit floats and without NMS, or simplify it (onnxsim)";
}

class OpenCvNetwork final : public OnnxNetwork {
 public:
  OpenCvNetwork(const DkbOnnxApi& api, std::string_view bytes, const std::string& name) : api_(api), name_(name) {
    std::array<char, 2048> error{};
    network_ = api_.open(bytes.data(), bytes.size(), error.data(), error.size());
    if (network_ == nullptr) throw InputError(name_ + ": OpenCV cannot read the graph " + explain_opencv(error.data()));
  }
  ~OpenCvNetwork() override { api_.close(network_); }
  OpenCvNetwork(const OpenCvNetwork&) = delete;
  OpenCvNetwork& operator=(const OpenCvNetwork&) = delete;

  std::vector<Output> forward(const std::vector<float>& blob, int width, int height) override {
    std::array<char, 2048> error{};
    std::array<DkbOnnxTensor, 8> tensors{};
    const int count = api_.forward(network_, blob.data(), width, height, tensors.data(),
                                   static_cast<int>(tensors.size()), error.data(), error.size());
    if (count < 0)
      throw InputError(name_ + ": OpenCV cannot run the graph at " + std::to_string(width) + " x " +
                       std::to_string(height) + " px " + explain_opencv(error.data()));
    std::vector<Output> outputs;
    for (int i = 0; i < std::min<int>(count, static_cast<int>(tensors.size())); ++i) {
      const DkbOnnxTensor& tensor = tensors[static_cast<size_t>(i)];
      size_t size = 1;
      for (int d = 0; d < tensor.rank; ++d) size *= static_cast<size_t>(tensor.dims[d]);
      outputs.push_back({"", {tensor.dims, tensor.dims + tensor.rank}, {tensor.data, size}});
    }
    return outputs;
  }
  Inference inference() const override { return Inference::opencv; }

 private:
  const DkbOnnxApi& api_;
  const std::string name_;
  void* network_ = nullptr;
};

}  // namespace

const DkbOnnxApi* load_opencv_module(std::string* reason) {
  const Module module{"libdkb_onnx.so", DKB_MODULE_LIBDIR, {DKB_MODULE_BUILD_DIR, DKB_MODULE_INSTALL_DIR}};
  void* symbol = module_symbol(module, "dkb_onnx_api_1", reason);
  return symbol == nullptr ? nullptr : reinterpret_cast<const DkbOnnxApi* (*)()>(symbol)();
}

std::unique_ptr<OnnxNetwork> open_opencv_network(const DkbOnnxApi& api, std::string_view bytes,
                                                 const std::string& name) {
  return std::make_unique<OpenCvNetwork>(api, bytes, name);
}

}  // namespace dkb
