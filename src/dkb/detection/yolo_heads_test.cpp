// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/yolo_heads.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dkb/image/test_frame.h"

namespace dkb {
namespace {

const std::vector<bool> kBoth = {true, true};

TEST(YoloHead, IsToldByTheNumberOfPredictions) {
  // 320 x 256: 40 x 32 + 20 x 16 + 10 x 8 = 1680 cells.
  const auto head = [](std::vector<int> dims) { return recognise_head(dims, 320, 256); };
  EXPECT_EQ(head({1, 5040, 85}), (HeadLayout{YoloHead::v5, 80, 5040}));
  EXPECT_EQ(head({1, 1680, 85}), (HeadLayout{YoloHead::yolox, 80, 1680}));
  EXPECT_EQ(head({1, 84, 1680}), (HeadLayout{YoloHead::v8, 80, 1680}));
  EXPECT_EQ(head({1, 300, 6}), std::nullopt);
  EXPECT_EQ(head({2, 5040, 85}), std::nullopt);
  EXPECT_EQ(head({1, 5040, 5}), std::nullopt);
  EXPECT_EQ(head({5040, 85}), std::nullopt);
  EXPECT_EQ(head({}), std::nullopt);
}

TEST(Letterbox, CentresForYolov5AndNotForYolox) {
  // 640 x 480 into 416 x 416: scale 0.65, 416 x 312, 104 rows of padding.
  const Letterbox middle = Letterbox::fit(YoloHead::v5, 640, 480, 416, 416);
  EXPECT_EQ(middle.scaled_height, 312);
  EXPECT_EQ(middle.top, 52);
  EXPECT_EQ(middle.left, 0);
  const Letterbox corner = Letterbox::fit(YoloHead::yolox, 640, 480, 416, 416);
  EXPECT_EQ(corner.top, 0);
  const Box box = middle.to_image({65, 117, 130, 65});
  EXPECT_NEAR(box.x, 100, 1e-4);  // 65 / 0.65
  EXPECT_NEAR(box.y, 100, 1e-4);  // (117 - 52) / 0.65
  EXPECT_NEAR(box.w, 200, 1e-4);
  EXPECT_NEAR(box.h, 100, 1e-4);
}

TEST(Letterbox, ThereAndBackIsTheSameBox) {
  for (const auto head : {YoloHead::v5, YoloHead::yolox, YoloHead::v8})
    for (const auto& [w, h] : {std::pair(640, 480), std::pair(480, 640), std::pair(33, 1000), std::pair(320, 256)}) {
      const Letterbox letterbox = Letterbox::fit(head, w, h, 320, 256);
      EXPECT_LE(letterbox.left + letterbox.scaled_width, 320);
      EXPECT_LE(letterbox.top + letterbox.scaled_height, 256);
      const Box box{3, 7, 20, 15}, back = letterbox.to_image(letterbox.to_input(box));
      EXPECT_NEAR(back.x, box.x, 1e-3);
      EXPECT_NEAR(back.y, box.y, 1e-3);
      EXPECT_NEAR(back.w, box.w, 1e-3);
      EXPECT_NEAR(back.h, box.h, 1e-3);
    }
}

Frame two_by_one() {
  auto image = std::make_shared<RgbdImage>();
  image->colour = ColourImage(2, 1);
  image->colour(0, 0) = {0, 51, 102};
  image->colour(1, 0) = {255, 51, 204};
  image->grey = grey_from_colour(image->colour);
  return frame_of(std::move(image));
}

TEST(FillBlob, ResizesBetweenPixelCentresAndPadsWithGrey) {
  // 2 x 1 into 4 x 4 for v5: scaled to 4 x 2, rows 1 and 2; samples at -0.25 (held), 0.25, 0.75, 1.25 (held).
  std::vector<float> blob;
  fill_blob(detector_input(two_by_one()), Letterbox::fit(YoloHead::v5, 2, 1, 4, 4), YoloHead::v5, &blob);
  ASSERT_EQ(blob.size(), 48u);
  const float red[] = {0, 0.25f, 0.75f, 1};
  for (size_t x = 0; x < 4; ++x) {
    EXPECT_NEAR(blob[x], 114 / 255.0, 1e-6);
    EXPECT_NEAR(blob[4 + x], red[x], 1e-6);
    EXPECT_NEAR(blob[8 + x], red[x], 1e-6);
    EXPECT_NEAR(blob[12 + x], 114 / 255.0, 1e-6);
    EXPECT_NEAR(blob[16 + 4 + x], 0.2, 1e-6);
  }
}

TEST(FillBlob, YoloxGetsBlueFirstUpTo255) {
  std::vector<float> blob;
  fill_blob(detector_input(two_by_one()), Letterbox::fit(YoloHead::yolox, 2, 1, 2, 2), YoloHead::yolox, &blob);
  const std::vector<float> expected = {102, 204, 114, 114, 51, 51, 114, 114, 0, 255, 114, 114};
  EXPECT_EQ(blob, expected);
}

TEST(FillBlob, GreyImagesFeedAllChannels) {
  const GreyImage grey(2, 2, 51);
  DetectorInput image;
  image.grey = {grey.data(), 2, 2, 0, PixelFormat::grey8};
  std::vector<float> blob;
  fill_blob(image, Letterbox::fit(YoloHead::v8, 2, 2, 2, 2), YoloHead::v8, &blob);
  for (const float value : blob) EXPECT_FLOAT_EQ(value, 0.2f);
}

TEST(Decode, Yolov5MultipliesObjectnessByTheBestClass) {
  const HeadLayout layout{YoloHead::v5, 2, 3};
  const std::vector<float> output = {100, 50, 20, 10, 0.8f, 0.1f, 0.5f,   // class 1, 0.4
                                     100, 50, 20, 10, 0.3f, 0.1f, 0.8f,   // 0.24: too weak
                                     60,  40, 8,  6,  0.5f, 1.0f, 0.0f};  // class 0, 0.5
  const auto found = decode(layout, output, 32, 32, kBoth, 0.25f);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].class_id, 1);
  EXPECT_FLOAT_EQ(found[0].score, 0.4f);
  EXPECT_EQ(found[0].box, (Box{90, 45, 20, 10}));
  EXPECT_EQ(found[1].box, (Box{56, 37, 8, 6}));
  EXPECT_EQ(decode(layout, output, 32, 32, {true, false}, 0.25f).size(), 1u);
}

TEST(Decode, YoloxCountsCellsStrideByStride) {
  // 64 x 32: 8 x 4 cells of stride 8, 4 x 2 of 16, 2 x 1 of 32: 42 in all.
  const HeadLayout layout{YoloHead::yolox, 2, 42};
  std::vector<float> output(42 * 7, 0.0f);
  const auto set = [&](size_t row, std::vector<float> values) {
    std::copy(values.begin(), values.end(), output.begin() + static_cast<ptrdiff_t>(row * 7));
  };
  set(8 + 3, {0.5f, 0.25f, 0, std::log(2.0f), 1, 0.9f, 0});  // stride 8, cell (3, 1)
  set(32 + 4 + 2, {0, 0, 0, 0, 1, 0, 0.8f});                 // stride 16, cell (2, 1)
  set(40 + 1, {0.5f, 0.5f, 0, 0, 0.5f, 0.8f, 0});            // stride 32, cell (1, 0)
  const auto found = decode(layout, output, 64, 32, kBoth, 0.25f);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].box, (Box{28 - 4, 10 - 8, 8, 16}));  // centre (3.5 x 8, 1.25 x 8)
  EXPECT_EQ(found[1].box, (Box{32 - 8, 16 - 8, 16, 16}));
  EXPECT_EQ(found[1].class_id, 1);
  EXPECT_EQ(found[2].box, (Box{48 - 16, 16 - 16, 32, 32}));
  EXPECT_FLOAT_EQ(found[2].score, 0.4f);
}

TEST(Decode, Yolov8IsStoredByChannel) {
  const HeadLayout layout{YoloHead::v8, 2, 3};
  const std::vector<float> output = {100,  60,   5,     // cx
                                     50,   40,   5,     // cy
                                     20,   8,    2,     // w
                                     10,   6,    2,     // h
                                     0.1f, 0.7f, 0.2f,  // class 0
                                     0.4f, 0.6f, 0.1f};
  const auto found = decode(layout, output, 32, 32, kBoth, 0.25f);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].class_id, 1);
  EXPECT_EQ(found[0].box, (Box{90, 45, 20, 10}));
  EXPECT_EQ(found[1].class_id, 0);
  EXPECT_FLOAT_EQ(found[1].score, 0.7f);
  EXPECT_EQ(found[1].box, (Box{56, 37, 8, 6}));
}

TEST(Decode, ValuesThatAreNotFiniteAreLeftOut) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const HeadLayout layout{YoloHead::v5, 1, 4};
  const std::vector<float> output = {nan, 50, 20, 10, 1,   1, 10, inf, 20, 10, 1, 1,
                                     10,  10, 20, 10, nan, 1, 10, 10,  -5, 10, 1, 1};
  EXPECT_TRUE(decode(layout, output, 32, 32, {true}, 0.25f).empty());
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
