// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/network_input.h"

#include <gtest/gtest.h>

#include <cstring>

#include "dkb/image/test_frame.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr Preprocessing kRgb;  // up to 1, in the middle
constexpr Preprocessing kBgr{.fit = Preprocessing::Fit::corner, .blue_first = true, .scale = {1, 1, 1}};

TEST(Letterbox, LiesInTheMiddleOrInTheCorner) {
  // 640 x 480 into 416 x 416: scale 0.65, 416 x 312, 104 rows of padding.
  const Letterbox middle = Letterbox::place(Preprocessing::Fit::centred, 640, 480, 416, 416);
  EXPECT_EQ(middle.scaled_height, 312);
  EXPECT_EQ(middle.top, 52);
  EXPECT_EQ(middle.left, 0);
  const Letterbox corner = Letterbox::place(Preprocessing::Fit::corner, 640, 480, 416, 416);
  EXPECT_EQ(corner.top, 0);
  const Box box = middle.to_image({65, 117, 130, 65});
  EXPECT_NEAR(box.x, 100, 1e-4);  // 65 / 0.65
  EXPECT_NEAR(box.y, 100, 1e-4);  // (117 - 52) / 0.65
  EXPECT_NEAR(box.w, 200, 1e-4);
  EXPECT_NEAR(box.h, 100, 1e-4);
}

TEST(Letterbox, StretchedFillsTheInput) {
  const Letterbox all = Letterbox::place(Preprocessing::Fit::stretched, 640, 480, 320, 320);
  EXPECT_EQ(all.scaled_width, 320);
  EXPECT_EQ(all.scaled_height, 320);
  EXPECT_EQ(all.to_image({80, 80, 160, 80}), (Box{160, 120, 320, 120}));
}

Box to_input(const Letterbox& l, const Box& b) {
  const float sx = static_cast<float>(l.scaled_width) / static_cast<float>(l.image_width);
  const float sy = static_cast<float>(l.scaled_height) / static_cast<float>(l.image_height);
  return {b.x * sx + static_cast<float>(l.left), b.y * sy + static_cast<float>(l.top), b.w * sx, b.h * sy};
}

TEST(Letterbox, ThereAndBackIsTheSameBox) {
  for (const auto fit : {Preprocessing::Fit::centred, Preprocessing::Fit::corner, Preprocessing::Fit::stretched})
    for (const auto& [w, h] : {std::pair(640, 480), std::pair(480, 640), std::pair(33, 1000), std::pair(320, 256)}) {
      const Letterbox letterbox = Letterbox::place(fit, w, h, 320, 256);
      EXPECT_LE(letterbox.left + letterbox.scaled_width, 320);
      EXPECT_LE(letterbox.top + letterbox.scaled_height, 256);
      const Box box{3, 7, 20, 15}, back = letterbox.to_image(to_input(letterbox, box));
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

std::vector<float> blob_of(const DetectorInput& image, const Preprocessing& how, int width, int height,
                           Simd simd = best_simd()) {
  std::vector<float> blob;
  fill_blob(image, Letterbox::place(how.fit, image.grey.width, image.grey.height, width, height), how, &blob, simd);
  return blob;
}

TEST(FillBlob, ResizesBetweenPixelCentresAndPadsWithGrey) {
  // 2 x 1 into 4 x 4: scaled to 4 x 2, rows 1 and 2; samples at -0.25 (held), 0.25, 0.75, 1.25 (held).
  const std::vector<float> blob = blob_of(detector_input(two_by_one()), kRgb, 4, 4);
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

TEST(FillBlob, BlueComesFirstUpTo255WhereANetworkWantsIt) {
  const std::vector<float> expected = {102, 204, 114, 114, 51, 51, 114, 114, 0, 255, 114, 114};
  EXPECT_EQ(blob_of(detector_input(two_by_one()), kBgr, 2, 2), expected);
}

TEST(FillBlob, NormalisesByMeanAndDeviationOfEachColour) {
  for (const bool blue_first : {false, true}) {
    const std::vector<float> blob = blob_of(detector_input(two_by_one()), stretched_by_imagenet(blue_first), 2, 1);
    EXPECT_NEAR(blob[blue_first ? 5 : 1], (255 - 123.675) / 58.395, 1e-5);
    EXPECT_NEAR(blob[2], (51 - 116.28) / 57.12, 1e-5);
    EXPECT_NEAR(blob[blue_first ? 1 : 5], (204 - 103.53) / 57.375, 1e-5);
  }
}

TEST(FillBlob, GreyImagesFeedAllChannels) {
  const GreyImage grey(2, 2, 51);
  DetectorInput image;
  image.grey = {grey.data(), 2, 2, 0, PixelFormat::grey8};
  for (const float value : blob_of(image, kRgb, 2, 2)) EXPECT_FLOAT_EQ(value, 0.2f);
}

// One value after the other, as the definition says.
std::vector<float> plain_blob(const DetectorInput& image, const Letterbox& box, const Preprocessing& how) {
  const auto sample = [](int i, int source, int target, int* first, int* second, float* weight) {
    const float step = static_cast<float>(source) / static_cast<float>(target);
    const float at = std::clamp((static_cast<float>(i) + 0.5f) * step - 0.5f, 0.0f, static_cast<float>(source - 1));
    *first = static_cast<int>(at);
    *second = std::min(*first + 1, source - 1);
    *weight = at - static_cast<float>(*first);
  };
  const ImageView& view = image.colour.empty() ? image.grey : image.colour;
  const int channels = image.colour.empty() ? 1 : 3;
  std::vector<float> blob;
  for (int c = 0; c < 3; ++c) {
    const int colour = how.blue_first ? 2 - c : c;
    const float scale = how.scale[static_cast<size_t>(colour)];
    const float offset = 0 - how.mean[static_cast<size_t>(colour)] * scale;
    for (int y = 0; y < box.input_height; ++y)
      for (int x = 0; x < box.input_width; ++x) {
        const int u = x - box.left, v = y - box.top;
        if (u < 0 || v < 0 || u >= box.scaled_width || v >= box.scaled_height) {
          blob.push_back(114 * scale + offset);
          continue;
        }
        int left, right, top, bottom;
        float across, down;
        sample(u, box.image_width, box.scaled_width, &left, &right, &across);
        sample(v, box.image_height, box.scaled_height, &top, &bottom, &down);
        const auto blended = [&](int column) {
          const int at = column * channels + (channels == 3 ? colour : 0);
          const float upper = view.row(top)[at];
          return (upper + down * (static_cast<float>(view.row(bottom)[at]) - upper)) * scale;
        };
        const float a = blended(left);
        blob.push_back(a + across * (blended(right) - a) + offset);
      }
  }
  return blob;
}

TEST(FillBlob, GivesTheBytesOfThePlainForm) {
  Random random(3);
  for (int i = 0; i < 40; ++i) {
    const int width = 1 + static_cast<int>(random.below(90)), height = 1 + static_cast<int>(random.below(70));
    const size_t stride = static_cast<size_t>(width) * 3 + random.below(5);  // rows need not be packed
    std::vector<uint8_t> pixels(stride * static_cast<size_t>(height));
    for (uint8_t& p : pixels) p = static_cast<uint8_t>(random.below(256));
    DetectorInput image;
    image.grey = {pixels.data(), width, height, stride, PixelFormat::grey8};
    if (i % 4 != 0) image.colour = {pixels.data(), width, height, stride, PixelFormat::rgb8};
    const int input_width = 1 + static_cast<int>(random.below(100)),
              input_height = 1 + static_cast<int>(random.below(80));
    for (const Preprocessing& how : {kRgb, kBgr, stretched_by_imagenet(true), stretched_by_imagenet(false)}) {
      const std::vector<float> plain =
          plain_blob(image, Letterbox::place(how.fit, width, height, input_width, input_height), how);
      for (const Simd simd : {Simd::scalar, Simd::avx2, Simd::avx512}) {
        if (simd > best_simd()) continue;
        const std::vector<float> blob = blob_of(image, how, input_width, input_height, simd);
        ASSERT_EQ(blob.size(), plain.size());
        EXPECT_EQ(std::memcmp(blob.data(), plain.data(), blob.size() * sizeof(float)), 0)
            << width << " x " << height << " to " << input_width << " x " << input_height;
      }
    }
  }
}

}  // namespace
}  // namespace dkb
