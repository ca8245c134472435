// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_network.h"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

constexpr const char* kModule = "libdkb_onnx.so";

// The folder of the program or shared library that this code was linked into.
fs::path own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&own_folder), &info) == 0 || info.dli_fname == nullptr) return {};
  const fs::path name = info.dli_fname;  // for a program as it was called, so without a folder when found by PATH
  std::error_code error;
  const fs::path self = fs::canonical(name.has_parent_path() ? name : fs::path("/proc/self/exe"), error);
  return error ? fs::path() : self.parent_path();
}

// Beside an installed program first; then the build tree, and where this build installs to.
// `reason`: why not, in one line, when the answer is null.
const DkbOnnxApi* load_module(std::string* reason) {
  *reason = std::string(kModule) + " is not installed beside it";
  std::vector<fs::path> folders;
  if (const fs::path own = own_folder(); !own.empty())
    folders = {own, (own / ".." / DKB_MODULE_LIBDIR).lexically_normal()};
  folders.emplace_back(DKB_MODULE_BUILD_DIR);
  folders.emplace_back(DKB_MODULE_INSTALL_DIR);
  for (const fs::path& folder : folders) {
    // Never closed: OpenCV's threads and statics outlive any network.
    void* module = folder.empty() ? nullptr : dlopen((folder / kModule).c_str(), RTLD_NOW | RTLD_LOCAL);
    if (module == nullptr) {
      const char* error = dlerror();
      std::error_code ignored;
      if (error != nullptr && !folder.empty() && fs::exists(folder / kModule, ignored)) *reason = error;
      continue;
    }
    if (void* symbol = dlsym(module, "dkb_onnx_api_1")) return reinterpret_cast<const DkbOnnxApi* (*)()>(symbol)();
  }
  return nullptr;
}

std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const size_t start = text.find(before);
  if (start == std::string::npos) return {};
  const size_t end = text.find(after, start + before.size());
  return end == std::string::npos ? std::string() : text.substr(start + before.size(), end - start - before.size());
}

// What to do about OpenCV's message, in one line with the layer first where it names one:
// `Node [Gemm@ai.onnx]:(onnx_node!name) parse error: ... error: reason`, or `Can't create layer "..." of type "Gemm"`.
std::string explain(const std::string& message) {
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

}  // namespace

bool OnnxNetwork::available() {
  std::string reason;
  return load_module(&reason) != nullptr;
}

OnnxNetwork::OnnxNetwork(std::string_view bytes, std::string name) : name_(std::move(name)) {
  std::string reason;
  api_ = load_module(&reason);
  if (api_ == nullptr)
    throw InputError(name_ + ": this build cannot run ONNX models (" + reason +
                     "); build with OpenCV's dnn module, or use --detector motion");
  std::array<char, 2048> error{};
  network_ = api_->open(bytes.data(), bytes.size(), error.data(), error.size());
  if (network_ == nullptr) throw InputError(name_ + ": OpenCV cannot read the graph " + explain(error.data()));
}

OnnxNetwork::~OnnxNetwork() {
  api_->close(network_);
}

std::vector<OnnxNetwork::Output> OnnxNetwork::forward(const std::vector<float>& blob, int width, int height) {
  std::array<char, 2048> error{};
  std::array<DkbOnnxTensor, 8> tensors{};
  const int count = api_->forward(network_, blob.data(), width, height, tensors.data(),
                                  static_cast<int>(tensors.size()), error.data(), error.size());
  if (count < 0)
    throw InputError(name_ + ": OpenCV cannot run the graph at " + std::to_string(width) + " x " +
                     std::to_string(height) + " px " + explain(error.data()));
  std::vector<Output> outputs;
  for (int i = 0; i < std::min<int>(count, static_cast<int>(tensors.size())); ++i) {
    const DkbOnnxTensor& tensor = tensors[static_cast<size_t>(i)];
    size_t size = 1;
    for (int d = 0; d < tensor.rank; ++d) size *= static_cast<size_t>(tensor.dims[d]);
    outputs.push_back({{tensor.dims, tensor.dims + tensor.rank}, {tensor.data, size}});
  }
  return outputs;
}

}  // namespace dkb
