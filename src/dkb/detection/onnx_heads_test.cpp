// SPDX-License-Identifier: Apache-2.0
// Whole graphs of every head: preprocessing, network, decoding, suppression, masks.
#include <cmath>
#include <fstream>

#include "dkb/detection/head_samples_test_util.h"
#include "dkb/detection/onnx_model_test_util.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {
using namespace head_test;

class OnnxHeadsTest : public onnx_test::ModelTest {
 protected:
  // What the sample's graph finds in an image of `width` x `height` px of a colour.
  Detections detect(const Sample& sample, int width, int height, Rgb colour, const std::string& more = "") const {
    OnnxDetector detector(write(onnx_test::put_graph(sample.width, sample.height, sample.outputs, more)), width,
                          height);
    EXPECT_EQ(detector.head().name, sample.head);
    return onnx_test::detect_in(detector, width, height, colour);
  }

  static void expect_person(const Detections& found, const Box& box, double score) {
    ASSERT_EQ(found.boxes.size(), 1u);
    const Detection& person = found.boxes[0];
    EXPECT_EQ(person.class_name, "person");
    EXPECT_NEAR(person.box.x, box.x, 1e-3);
    EXPECT_NEAR(person.box.y, box.y, 1e-3);
    EXPECT_NEAR(person.box.w, box.w, 1e-3);
    EXPECT_NEAR(person.box.h, box.h, 1e-3);
    EXPECT_NEAR(person.score, score, 1e-4);
  }
  // The transformers' heads are told by names, which OpenCV does not tell.
  static bool has_names() { return GetParam() == Inference::onnxruntime; }
};

constexpr Rgb kRed{204, 0, 0}, kBlue{0, 0, 204};

TEST_P(OnnxHeadsTest, NanoDetPlusGetsStretchedNormalisedBgr) {
  // In the input 0 ... 48 x 32 ... 56, in an image twice as wide and one and a half times as high.
  expect_person(detect(nanodet_plus(), 128, 96, kBlue), {0, 48, 96, 36}, 0.4 * (204 - 103.53) / 57.375);
  EXPECT_TRUE(detect(nanodet_plus(), 128, 96, kRed).boxes.empty());
}

TEST_P(OnnxHeadsTest, PicoDetGetsStretchedNormalisedRgb) {
  const double score = 0.4 * (204 - 123.675) / 58.395;
  for (const Sample& sample : {picodet(), picodet_boxes()}) {
    expect_person(detect(sample, 128, 96, kRed), {40, 6, 48, 36}, score);
    EXPECT_TRUE(detect(sample, 128, 96, kBlue).boxes.empty());
  }
}

TEST_P(OnnxHeadsTest, YoloV8SegGivesMasksOfWhatIsAskedFor) {
  const Detections found = detect(yolov8_seg(), 192, 128, kRed);
  expect_person(found, {32, 32, 128, 64}, 0.8);
  ASSERT_EQ(found.mask.width(), 192);
  for (int y = 0; y < 128; ++y)
    for (int x = 0; x < 192; ++x)
      ASSERT_EQ(found.mask(x, y), x >= 32 && x < 96 && y >= 32 && y < 96 ? 255 : 0) << x << ' ' << y;
  EXPECT_EQ(detect(yolov8_seg(), 192, 128, kBlue), Detections());
}

TEST_P(OnnxHeadsTest, RfDetrNumbersClassesAsCocoDoes) {
  if (!has_names()) GTEST_SKIP() << "skipped: no names of outputs";
  // (14, 7) to (42, 21) of 56 x 56
  const double score = 1 / (1 + std::exp(-(204 - 123.675) / 58.395));
  expect_person(detect(rf_detr(), 112, 56, kRed), {28, 7, 56, 14}, score);
  EXPECT_TRUE(detect(rf_detr(), 112, 56, kBlue).boxes.empty());
}

TEST_P(OnnxHeadsTest, RfDetrSegGivesMasks) {
  if (!has_names()) GTEST_SKIP() << "skipped: no names of outputs";
  const Detections found = detect(rf_detr_seg(), 112, 56, kRed);
  ASSERT_EQ(found.boxes.size(), 1u);
  // Between the rows 2 and 3 of 4 px each it falls through 0: at 12 px.
  for (int y = 0; y < 56; ++y)
    for (int x = 0; x < 112; ++x)
      ASSERT_EQ(found.mask(x, y), x >= 28 && x < 84 && y >= 12 && y < 21 ? 255 : 0) << x << ' ' << y;
}

TEST_P(OnnxHeadsTest, LabelsOfAModelOfOnesOwnMayLeaveOutItsBackground) {
  if (!has_names()) GTEST_SKIP() << "skipped: no names of outputs";
  Put boxes("dets", {1, 1, 4}), logits("labels", {1, 1, 3});
  boxes.bias = {0.5f, 0.5f, 0.5f, 0.5f};
  logits.bias = {-9, 2, -9};
  OnnxOptions options = write(onnx_test::put_graph(64, 64, {boxes, logits}));
  EXPECT_THROW(OnnxDetector(options, 64, 64), InputError);
  options.labels = folder_ / "labels.txt";
  std::ofstream(options.labels) << "chair\nrobot\n";
  options.classes = "robot";
  OnnxDetector detector(options, 64, 64);
  const GreyImage grey(64, 64, 0);
  DetectorInput image;
  image.grey = {grey.data(), 64, 64, 0, PixelFormat::grey8};
  ASSERT_EQ(detector.detect(image).boxes.size(), 1u);
  EXPECT_EQ(detector.detect(image).boxes[0].class_name, "robot");
}

TEST_P(OnnxHeadsTest, DFineGetsStretchedRgbUpToOne) {
  if (!has_names()) GTEST_SKIP() << "skipped: no names of outputs";
  expect_person(detect(d_fine(), 128, 64, kRed), {32, 8, 64, 16}, 1 / (1 + std::exp(-0.8)));
  EXPECT_NEAR(detect(d_fine(), 128, 64, kBlue).boxes.at(0).score, 0.5, 1e-4);
}

TEST_P(OnnxHeadsTest, ScoredBoxesAreAskedForInTheInputsSize) {
  using namespace onnx_test;
  // Boxes as shares of the input, times the size that is given.
  Sample sample = scored_boxes();
  Put& boxes = sample.outputs[1];
  boxes.name = "shares";
  for (float& v : boxes.bias) v /= 64;
  const std::string more = value_info(11, "orig_target_sizes", {1, 2}, 7) + tensor("of_boxes", {1, 1, 4}) +
                           node("Cast", {"orig_target_sizes"}, "size", attribute("to", int64_t{1})) +
                           node("Concat", {"size", "size"}, "sizes", attribute("axis", int64_t{1})) +
                           node("Reshape", {"sizes", "of_boxes"}, "factors") +
                           node("Mul", {"shares", "factors"}, "boxes") + value_info(12, "boxes", {1, 2, 4});
  if (!has_names()) {
    EXPECT_THROW(detect(sample, 128, 64, kRed, more), InputError);
    return;
  }
  expect_person(detect(sample, 128, 64, kRed, more), {32, 8, 64, 16}, 0.8);
}

TEST_P(OnnxHeadsTest, OverlapsOfTransformersStay) {
  if (!has_names()) GTEST_SKIP() << "skipped: no names of outputs";
  Sample sample = d_fine();
  sample.outputs[0]({0, 0, kPerson}) = 1;
  for (int k = 0; k < 4; ++k) sample.outputs[1]({0, 0, k}) = sample.outputs[1]({0, 2, k});
  EXPECT_EQ(detect(sample, 64, 64, kRed).boxes.size(), 2u);
}

INSTANTIATE_TEST_SUITE_P(By, OnnxHeadsTest, onnx_test::kBoth, onnx_test::inference_name);

}  // namespace
}  // namespace dkb
