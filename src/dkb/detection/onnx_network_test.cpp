// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_network.h"

#include <cmath>
#include <iostream>

#include "dkb/detection/onnx_file.h"
#include "dkb/detection/onnx_graph_test_util.h"
#include "dkb/detection/onnx_model_test_util.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/random.h"
#include "dkb/util/test_data.h"

namespace dkb {
namespace {
using namespace onnx_test;
namespace fs = std::filesystem;

std::unique_ptr<OnnxNetwork> open(Inference inference, const std::string& bytes) {
  return open_network(inference, bytes, read_onnx_input(bytes, "m.onnx"), "m.onnx");
}

// Values of 0 ... `largest`, the same in every run.
std::vector<float> noise(int width, int height, float largest) {
  Random random(7);
  std::vector<float> blob(3 * static_cast<size_t>(width) * static_cast<size_t>(height));
  for (float& v : blob) v = largest * static_cast<float>(random.below(256)) / 255;
  return blob;
}

TEST(Inference, IsToldByItsName) {
  for (const Inference inference : {Inference::automatic, Inference::onnxruntime, Inference::opencv})
    EXPECT_EQ(inference_named(to_string(inference)), inference);
  try {
    inference_named("onnxruntme");
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("did you mean \"onnxruntime\""), std::string::npos) << e.what();
  }
}

class OnnxNetworkTest : public ModelTest {};

TEST_P(OnnxNetworkTest, ComputesTheGraph) {
  // output[i] = bias[i] + slope of the first channel x its mean, as 1 x 2 x 1
  Put out("output", {1, 2, 1});
  out.bias = {1, 2};
  out.slope[0] = {1, 10};
  const auto network = open(GetParam(), put_graph(64, 32, {out}));
  EXPECT_EQ(network->inference(), GetParam());
  std::vector<float> blob(3 * 64 * 32, 0.0f);
  std::fill_n(blob.begin(), 64 * 32, 0.5f);
  for (int again = 0; again < 3; ++again) {
    const auto outputs = network->forward(blob, 64, 32);
    ASSERT_EQ(outputs.size(), 1u);
    EXPECT_EQ(outputs[0].dims, (std::vector{1, 2, 1}));
    ASSERT_EQ(outputs[0].values.size(), 2u);
    EXPECT_FLOAT_EQ(outputs[0].values[0], 1.5f);
    EXPECT_FLOAT_EQ(outputs[0].values[1], 7.0f);
  }
}

TEST_P(OnnxNetworkTest, OpenGraphsRunAtAnySize) {
  std::vector<float> cell(7, 0.25f);
  const auto network = open(GetParam(), yolox_graph(-1, -1, cell));
  for (const auto& [width, height, cells] : {std::array{96, 64, 126}, {64, 64, 84}, {96, 64, 126}}) {
    const auto outputs = network->forward(noise(width, height, 1), width, height);
    ASSERT_EQ(outputs.size(), 1u);
    EXPECT_EQ(outputs[0].dims, (std::vector{1, cells, 7}));
    EXPECT_EQ(outputs[0].values.back(), 0.25f);
  }
}

TEST_P(OnnxNetworkTest, WhatCannotBeReadIsNamedInOneLine) {
  const std::string tensors = value_info(11, "images", {1, 3, 32, 32}) + value_info(12, "output", {1, 3, 32, 32});
  for (const std::string& graph :
       {model(node("Frobnicate", {"images"}, "output") + tensors), std::string("no graph")}) {
    try {
      open_network(GetParam(), graph, {"images"}, "m.onnx");
      ADD_FAILURE();
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find("m.onnx: "), 0u) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(By, OnnxNetworkTest, kBoth, inference_name);

struct YoloModel {
  const char* file;
  int width, height;
  float largest;  // value of the input
};

class OnnxRealNetworkTest : public testing::TestWithParam<YoloModel> {};

// Sizes and logarithms of sizes go into boxes of hundreds of pixels: a thousandth of a pixel, or of the value.
TEST_P(OnnxRealNetworkTest, GivesTheSameByOnnxRuntimeAndOpenCv) {
  const auto& [file, width, height, largest] = GetParam();
  const fs::path path = test_data() / "models" / file;
  if (!fs::exists(path)) GTEST_SKIP() << "skipped: no " << path;
  for (const Inference inference : {Inference::onnxruntime, Inference::opencv})
    if (!available(inference)) GTEST_SKIP() << "skipped: no " << to_string(inference) << " here";
  const std::string bytes = read_file(path);
  const std::vector<float> blob = noise(width, height, largest);
  const auto fast = open(Inference::onnxruntime, bytes), slow = open(Inference::opencv, bytes);
  const auto a = fast->forward(blob, width, height), b = slow->forward(blob, width, height);
  ASSERT_FALSE(a.empty());
  ASSERT_EQ(a[0].dims, b[0].dims);
  double largest_difference = 0;
  for (size_t i = 0; i < a[0].values.size(); ++i)
    largest_difference = std::max(largest_difference, std::abs(static_cast<double>(a[0].values[i] - b[0].values[i])) /
                                                          std::max(1.0, std::abs(double{b[0].values[i]})));
  EXPECT_LT(largest_difference, 1e-3);
  std::cout << file << ": they differ by " << largest_difference << "\n";
  const auto other = open(Inference::onnxruntime, bytes);
  const auto again = other->forward(blob, width, height);
  EXPECT_TRUE(std::equal(a[0].values.begin(), a[0].values.end(), again[0].values.begin())) << "the same bytes again";
}

INSTANTIATE_TEST_SUITE_P(Models, OnnxRealNetworkTest,
                         testing::Values(YoloModel{"yolov5n_640x480.onnx", 640, 480, 1},
                                         YoloModel{"yolov5n_320x256.onnx", 320, 256, 1},
                                         YoloModel{"yolox_nano.onnx", 416, 416, 255}));

}  // namespace
}  // namespace dkb
