// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/reduced_jpeg.h"

#include <gtest/gtest.h>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

// 100 x 77: at 7 pixels a side two columns are left over, at 8 four columns and five rows.
TEST(ReducedJpeg, IsOfTheMeansOfBlocks) {
  Random random(1);
  ColourImage picture(100, 77);
  const Image<uint16_t> depth(100, 77, 5000);
  const auto byte = [&] { return static_cast<uint8_t>(random.below(256)); };
  for (size_t i = 0; i < picture.size(); ++i) picture.data()[i] = {byte(), byte(), byte()};
  Camera camera;
  camera.width = 100, camera.height = 77, camera.fx = camera.fy = 100, camera.cx = 50, camera.cy = 38;
  const Frame frame(camera, {.stamp_ns = 1,
                             .colour = {picture.data(), 100, 77, 0, PixelFormat::rgb8},
                             .depth = {depth.data(), 100, 77, 0, PixelFormat::depth_u16}});
  for (const int factor : {1, 7, 8}) {
    ColourImage means(100 / factor, 77 / factor);
    for (int y = 0; y < means.height(); ++y)
      for (int x = 0; x < means.width(); ++x) {
        int r = 0, g = 0, b = 0;
        for (int dy = 0; dy < factor; ++dy)
          for (int dx = 0; dx < factor; ++dx) {
            const Rgb& p = picture(x * factor + dx, y * factor + dy);
            r += p.r, g += p.g, b += p.b;
          }
        const int area = factor * factor;
        means(x, y) = {static_cast<uint8_t>(r / area), static_cast<uint8_t>(g / area), static_cast<uint8_t>(b / area)};
      }
    EXPECT_EQ(reduced_jpeg(frame, factor, 75), encode_jpeg(means, 75)) << factor;
  }
  EXPECT_EQ(reduced_jpeg(Frame(), 2, 75), "");
}

}  // namespace
}  // namespace dkb
