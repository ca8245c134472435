// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "dkb/detection/onnx_detector.h"
#include "dkb/image/test_frame.h"

namespace dkb::onnx_test {

// For tests that run by each of what computes networks, with a folder for the models that they write.
class ModelTest : public testing::TestWithParam<Inference> {
 protected:
  void SetUp() override {
    if (!available(GetParam())) GTEST_SKIP() << "skipped: no " << to_string(GetParam()) << " here";
    const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test.test_suite_name()) + test.name();
    std::replace(name.begin(), name.end(), '/', '_');
    folder_ = std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_onnx_" + name);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }

  OnnxOptions write(const std::string& bytes) const {
    OnnxOptions options;
    options.model = folder_ / "m.onnx";
    options.inference = GetParam();
    std::ofstream(options.model, std::ios::binary) << bytes;
    return options;
  }

  std::filesystem::path folder_;
};

inline const auto kBoth = testing::Values(Inference::onnxruntime, Inference::opencv);
inline std::string inference_name(const testing::TestParamInfo<Inference>& inference) {
  return to_string(inference.param);
}

inline Frame frame_of(ColourImage colour) {
  auto image = std::make_shared<RgbdImage>();
  image->grey = grey_from_colour(colour);
  image->colour = std::move(colour);
  return dkb::frame_of(std::move(image));
}

// What `detector` finds in an image of one colour.
inline Detections detect_in(OnnxDetector& detector, int width, int height, Rgb colour) {
  return detector.detect(detector_input(frame_of(ColourImage(width, height, colour))));
}

}  // namespace dkb::onnx_test
