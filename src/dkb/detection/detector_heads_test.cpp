// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detector_heads.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dkb/detection/head_samples_test_util.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {
using head_test::as_network_outputs;
using head_test::Put;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

// One output of 1 x rows x columns, and its head at this input.
struct Decoded {
  std::string head;
  HeadLayout layout;
  std::vector<Prediction> found;
};
Decoded decode(int rows, int columns, const std::vector<float>& values, int width, int height,
               const std::vector<bool>& classes, float min_score = 0.25f) {
  const std::vector<OnnxNetwork::Output> outputs = {{"output", {1, rows, columns}, values}};
  const auto layout = recognise_head(outputs, width, height);
  if (!layout) return {};
  return {layout->head->name, *layout, layout->head->decode(*layout, outputs, width, height, {classes, min_score})};
}

std::string head_of(const std::vector<int>& dims, int width, int height) {
  size_t size = 1;
  for (const int d : dims) size *= static_cast<size_t>(d);
  const std::vector<float> values(size, 0.0f);
  const std::vector<OnnxNetwork::Output> outputs = {{"output", dims, values}};
  const auto layout = recognise_head(outputs, width, height);
  return layout ? std::string(layout->head->name) + " " + std::to_string(layout->classes) : "none";
}

TEST(DetectorHead, IsToldByTheNumberOfPredictions) {
  // 320 x 256: 40 x 32 + 20 x 16 + 10 x 8 = 1680 cells, and 5 x 4 of stride 64.
  const auto head = [](const std::vector<int>& dims) { return head_of(dims, 320, 256); };
  EXPECT_EQ(head({1, 5040, 85}), "YOLOv5 80");
  EXPECT_EQ(head({1, 1680, 85}), "YOLOX 80");
  EXPECT_EQ(head({1, 84, 1680}), "YOLOv8 80");
  EXPECT_EQ(head({1, 1700, 112}), "NanoDet-Plus 80");
  EXPECT_EQ(head_of({1, 3598, 112}, 416, 416), "NanoDet-Plus 80");  // stride 64 covers what is left: 7 x 7
  EXPECT_EQ(head({1, 300, 6}), "none");
  EXPECT_EQ(head({2, 5040, 85}), "none");
  EXPECT_EQ(head({1, 5040, 5}), "none");
  EXPECT_EQ(head({1, 1700, 32}), "none");
  EXPECT_EQ(head({5040, 85}), "none");
  EXPECT_EQ(head({}), "none");
  EXPECT_EQ(head_of({1, 0, 85}, 16, 16), "none");
}

TEST(DetectorHead, OfEverySampleIsRecognised) {
  for (const head_test::Sample& sample : head_test::samples()) {
    const auto layout = recognise_head(as_network_outputs(sample.outputs), sample.width, sample.height);
    ASSERT_TRUE(layout) << sample.head;
    EXPECT_EQ(layout->head->name, sample.head);
  }
}

TEST(DetectorHead, OfATransformerOfFourClassesIsToldByNames) {
  Put boxes("dets", {1, 2, 4}), logits("labels", {1, 2, 4});
  boxes.bias = {0.5f, 0.5f, 1, 1, 0, 0, 0, 0};
  logits.bias = {-9, -9, -9, 3, -9, -9, -9, -9};
  for (const std::vector<Put>& order : {std::vector{boxes, logits}, std::vector{logits, boxes}}) {
    const auto outputs = as_network_outputs(order);
    const auto layout = recognise_head(outputs, 64, 64);
    ASSERT_TRUE(layout);
    const auto found = layout->head->decode(*layout, outputs, 64, 64, {{true, true, true, true}, 0.25f});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].class_id, 3);
    EXPECT_EQ(found[0].box, (Box{0, 0, 64, 64}));
  }
}

TEST(Decode, Yolov5MultipliesObjectnessByTheBestClass) {
  std::vector<float> values = {100, 50, 20, 10, 0.8f, 0.1f, 0.5f,   // class 1, 0.4
                               100, 50, 20, 10, 0.3f, 0.1f, 0.8f,   // 0.24: too weak
                               60,  40, 8,  6,  0.5f, 1.0f, 0.0f};  // class 0, 0.5
  values.resize(63 * 7);                                            // 32 x 32: three boxes in each of 21 cells
  const Decoded both = decode(63, 7, values, 32, 32, {true, true});
  EXPECT_EQ(both.head, "YOLOv5");
  ASSERT_EQ(both.found.size(), 2u);
  EXPECT_EQ(both.found[0].class_id, 1);
  EXPECT_FLOAT_EQ(both.found[0].score, 0.4f);
  EXPECT_EQ(both.found[0].box, (Box{90, 45, 20, 10}));
  EXPECT_EQ(both.found[1].box, (Box{56, 37, 8, 6}));
  EXPECT_EQ(decode(63, 7, values, 32, 32, {true, false}).found.size(), 1u);
  EXPECT_EQ(decode(63, 7, values, 32, 32, {true}).found.size(), 1u) << "a class without a label";
}

TEST(Decode, YoloxCountsCellsStrideByStride) {
  // 64 x 32: 8 x 4 cells of stride 8, 4 x 2 of 16, 2 x 1 of 32: 42 in all.
  std::vector<float> output(42 * 7, 0.0f);
  const auto set = [&](size_t row, std::vector<float> values) {
    std::copy(values.begin(), values.end(), output.begin() + static_cast<ptrdiff_t>(row * 7));
  };
  set(8 + 3, {0.5f, 0.25f, 0, std::log(2.0f), 1, 0.9f, 0});  // stride 8, cell (3, 1)
  set(32 + 4 + 2, {0, 0, 0, 0, 1, 0, 0.8f});                 // stride 16, cell (2, 1)
  set(40 + 1, {0.5f, 0.5f, 0, 0, 0.5f, 0.8f, 0});            // stride 32, cell (1, 0)
  const Decoded all = decode(42, 7, output, 64, 32, {true, true});
  EXPECT_EQ(all.head, "YOLOX");
  ASSERT_EQ(all.found.size(), 3u);
  EXPECT_EQ(all.found[0].box, (Box{28 - 4, 10 - 8, 8, 16}));  // centre (3.5 x 8, 1.25 x 8)
  EXPECT_EQ(all.found[1].box, (Box{32 - 8, 16 - 8, 16, 16}));
  EXPECT_EQ(all.found[1].class_id, 1);
  EXPECT_EQ(all.found[2].box, (Box{48 - 16, 16 - 16, 32, 32}));
  EXPECT_FLOAT_EQ(all.found[2].score, 0.4f);
}

TEST(Decode, Yolov8IsStoredByChannel) {
  Put out("output", {1, 6, 21});
  const float values[6][3] = {{100, 60, 5},        // cx
                              {50, 40, 5},         // cy
                              {20, 8, 2},          // w
                              {10, 6, 2},          // h
                              {0.1f, 0.7f, 0.2f},  // class 0
                              {0.4f, 0.6f, 0.1f}};
  for (int row = 0; row < 6; ++row)
    for (int i = 0; i < 3; ++i) out({0, row, i}) = values[row][i];
  const Decoded all = decode(6, 21, out.bias, 32, 32, {true, true});
  EXPECT_EQ(all.head, "YOLOv8");
  ASSERT_EQ(all.found.size(), 2u);
  EXPECT_EQ(all.found[0].class_id, 1);
  EXPECT_EQ(all.found[0].box, (Box{90, 45, 20, 10}));
  EXPECT_EQ(all.found[1].class_id, 0);
  EXPECT_FLOAT_EQ(all.found[1].score, 0.7f);
  EXPECT_EQ(all.found[1].box, (Box{56, 37, 8, 6}));
}

TEST(Decode, ValuesThatAreNotFiniteAreLeftOut) {
  std::vector<float> values = {kNan, 50, 20, 10, 1,    1, 10, kInf, 20, 10, 1, 1,
                               10,   10, 20, 10, kNan, 1, 10, 10,   -5, 10, 1, 1};
  values.resize(63 * 6);
  EXPECT_EQ(decode(63, 6, values, 32, 32, {true}).head, "YOLOv5");
  EXPECT_TRUE(decode(63, 6, values, 32, 32, {true}).found.empty());
}

TEST(Decode, AnyMutationIsDecodedIntoFiniteBoxesOrRefused) {
  const float odd[] = {kNan, kInf, -kInf, 3e38f, -3e38f, 1e-40f, -1, 0, 0.5f, 1, 100};
  const Letterbox letterbox = Letterbox::place(Preprocessing::Fit::centred, 96, 72, 64, 64);
  Random random(11);
  size_t refused = 0, found = 0;
  const std::vector<head_test::Sample> samples = head_test::samples();
  for (int i = 0; i < 4000; ++i) {
    const head_test::Sample& sample = samples[static_cast<size_t>(i) % samples.size()];
    std::vector<Put> puts = sample.outputs;
    for (Put& put : puts)
      for (uint32_t k = random.below(60); k > 0; --k) {
        const uint32_t size = static_cast<uint32_t>(put.bias.size());
        put.bias[random.below(size)] = odd[random.below(std::size(odd))];
      }
    std::vector<OnnxNetwork::Output> outputs = as_network_outputs(puts);
    if (random.below(4) == 0) {
      std::vector<int>& dims = outputs[random.below(static_cast<uint32_t>(outputs.size()))].dims;
      switch (random.below(4)) {
        case 0:
          dims[random.below(static_cast<uint32_t>(dims.size()))] = static_cast<int>(random.below(200)) - 20;
          break;
        case 1:
          dims.pop_back();
          break;
        case 2:
          dims[random.below(static_cast<uint32_t>(dims.size()))] = std::numeric_limits<int>::max();
          break;
        default:
          outputs.erase(outputs.begin() + random.below(static_cast<uint32_t>(outputs.size())));
      }
    }
    const auto layout = recognise_head(outputs, sample.width, sample.height);
    if (!layout) {
      ++refused;
      continue;
    }
    for (const Prediction& p : suppress_overlaps(
             layout->head->decode(*layout, outputs, sample.width, sample.height, {std::vector<bool>(80, true), 0.25f}),
             0.45f)) {
      ++found;
      EXPECT_TRUE(std::isfinite(p.box.x + p.score) && p.box.w > 0 && p.box.h > 0) << sample.head;
      EXPECT_TRUE(p.class_id >= 0 && p.class_id < 80) << sample.head;
      if (!layout->head->mask) continue;
      GreyImage mask(96, 72, 0);
      paint_mask(layout->head->mask(*layout, outputs, p), letterbox, letterbox.to_image(p.box), &mask);
    }
  }
  EXPECT_GT(refused, 300u);
  EXPECT_GT(found, 5000u);
}

TEST(PaintMask, SetsThePixelsOfTheBoxAboveZero) {
  // A mask of 4 x 1 over an input of 8 x 2, of which the image of 4 x 2 covers the right half: it ends where the mask
  // falls through 0, between its centres 2.5 and 3.5 at 3.1: 2.2 px into the image.
  const Letterbox letterbox{8, 2, 4, 2, 4, 2, 4, 0};
  const MaskLogits logits{4, 1, {-1, 1, 0.6f, -0.4f}};
  GreyImage mask(4, 2, 0);
  paint_mask(logits, letterbox, {0, 0, 4, 1}, &mask);
  const GreyImage expected = [] {
    GreyImage image(4, 2, 0);
    image(0, 0) = image(1, 0) = 255;  // centres at 0.5 and 1.5
    return image;
  }();
  EXPECT_EQ(mask, expected);
  paint_mask(logits, letterbox, {0.6f, -5, 100, 100}, &mask);
  EXPECT_EQ(mask(0, 1), 0) << "its centre lies beyond the box";
  EXPECT_EQ(mask(1, 1), 255);
  EXPECT_EQ(mask(0, 0), 255) << "what was set stays";
}

TEST(SuppressOverlaps, KeepsTheBestOfAClassAndOtherClasses) {
  const auto kept = suppress_overlaps({{0, {0, 0, 10, 10}, 0.5f},
                                       {0, {1, 0, 10, 10}, 0.9f},   // overlaps the first by 90 / 110
                                       {1, {1, 0, 10, 10}, 0.6f},   // another class
                                       {0, {6, 0, 10, 10}, 0.7f}},  // overlaps the best by 50 / 150
                                      0.45f);
  ASSERT_EQ(kept.size(), 3u);
  EXPECT_EQ(kept[0].score, 0.9f);
  EXPECT_EQ(kept[1].score, 0.7f);
  EXPECT_EQ(kept[2].score, 0.6f);
}

TEST(SuppressOverlaps, EqualScoresKeepTheOrderGiven) {
  const auto kept = suppress_overlaps({{0, {0, 0, 10, 10}, 0.5f}, {0, {1, 0, 10, 10}, 0.5f}}, 0.45f);
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept[0].box.x, 0);
}

}  // namespace
}  // namespace dkb
