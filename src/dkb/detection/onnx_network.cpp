// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_network.h"

#include <algorithm>
#include <iterator>

#include "dkb/detection/opencv_network.h"
#include "dkb/detection/ort_network.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"

namespace dkb {

const char* to_string(Inference inference) {
  return inference == Inference::onnxruntime ? "onnxruntime" : inference == Inference::opencv ? "opencv" : "auto";
}

Inference inference_named(const std::string& name) {
  std::vector<std::string> known;
  for (const Inference inference : {Inference::automatic, Inference::onnxruntime, Inference::opencv}) {
    known.emplace_back(to_string(inference));
    if (name == known.back()) return inference;
  }
  throw InputError("--inference: there is no \"" + name + "\"" + did_you_mean(name, known) +
                   "; what computes a network: auto, onnxruntime, opencv");
}

std::unique_ptr<OnnxNetwork> open_network(Inference inference, std::string_view bytes, const OnnxInput& input,
                                          const std::string& name) {
  std::string reason;
  if (inference != Inference::opencv) {
    if (const auto library = find_onnxruntime(&reason)) return open_ort_network(*library, bytes, input, name);
    // A library that the user named is never passed over silently.
    if (inference == Inference::onnxruntime || onnxruntime_is_named())
      throw InputError(
          name + ": ONNX Runtime cannot be used (" + reason +
          "); `make onnxruntime` fetches it, $DKB_ONNXRUNTIME names another, --inference opencv needs none");
  }
  if (const DkbOnnxApi* api = load_opencv_module(&reason)) {
    if (!input.size_name.empty())
      throw InputError(name + ": OpenCV cannot give the input " + input.size_name +
                       "; get ONNX Runtime (`make onnxruntime`)");
    return open_opencv_network(*api, bytes, name);
  }
  throw InputError(
      name + ": this build cannot run ONNX models by OpenCV (" + reason +
      "); get ONNX Runtime (`make onnxruntime`), build with OpenCV's dnn module, or use --detector motion");
}

bool available(Inference inference) {
  std::string reason;
  return (inference != Inference::opencv && find_onnxruntime(&reason)) ||
         (inference != Inference::onnxruntime && load_opencv_module(&reason) != nullptr);
}

}  // namespace dkb
