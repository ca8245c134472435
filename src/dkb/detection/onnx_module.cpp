// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_module.h"

#include <memory>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "dkb/util/module_guard.h"

namespace {

using dkb::guarded;

struct Network {
  cv::dnn::Net net;
  std::vector<std::string> output_names;
  std::vector<cv::Mat> outputs;
};

void* open_network(const char* bytes, size_t size, char* error, size_t error_size) {
  return guarded<void*>(nullptr, error, error_size, [&]() -> void* {
    cv::setNumThreads(1);
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    auto network = std::make_unique<Network>();
    network->net = cv::dnn::readNetFromONNX(bytes, size);
    network->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    network->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    network->output_names = network->net.getUnconnectedOutLayersNames();
    return network.release();
  });
}

int forward_network(void* network, const float* blob, int width, int height, DkbOnnxTensor* outputs, int capacity,
                    char* error, size_t error_size) {
  return guarded(-1, error, error_size, [&] {
    auto& self = *static_cast<Network*>(network);
    const int dims[] = {1, 3, height, width};
    self.net.setInput(cv::Mat(4, dims, CV_32F, const_cast<float*>(blob)));
    self.net.forward(self.outputs, self.output_names);
    int count = 0;
    for (cv::Mat& output : self.outputs) {
      if (output.depth() != CV_32F || output.dims > 6) continue;
      if (!output.isContinuous()) output = output.clone();
      if (count < capacity) {
        DkbOnnxTensor& tensor = outputs[count];
        tensor.data = output.ptr<float>();
        tensor.rank = output.dims;
        for (int i = 0; i < output.dims; ++i) tensor.dims[i] = output.size[i];
      }
      ++count;
    }
    return count;
  });
}

void close_network(void* network) {
  delete static_cast<Network*>(network);
}

}  // namespace

extern "C" const DkbOnnxApi* dkb_onnx_api_1() {
  static const DkbOnnxApi api{open_network, forward_network, close_network};
  return &api;
}
