// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/repeated_depth.h"

#include <gtest/gtest.h>

#include "dkb/image/test_frame.h"

namespace dkb {
namespace {

Frame frame_at(double time, uint8_t grey, float depth, float step = 0.01F) {
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = image->depth_timestamp = time;
  image->grey = GreyImage(8, 6, grey);
  image->depth = DepthImage(8, 6, depth);
  if (step > 0) image->depth(0, 0) += step;
  return frame_of(std::move(image));
}

TEST(RepeatedDepth, IsLeftOutWhileColourGoesOn) {
  RepeatedDepth repeated;
  EXPECT_EQ(repeated.left_out(frame_at(0, 1, 2)).image()->depth(3, 3), 2);
  EXPECT_EQ(repeated.take_warning(), "");
  for (int i = 1; i < 4; ++i) {
    Frame given = frame_at(0.1 * i, static_cast<uint8_t>(1 + i), 2);
    given.set_prior(MotionPrior{});
    const Frame left = repeated.left_out(given);
    EXPECT_EQ(left.image()->depth, DepthImage(8, 6)) << "the first of them is what all are held against";
    EXPECT_EQ(left.image()->grey, given.image()->grey);
    EXPECT_EQ(left.image()->timestamp, given.image()->timestamp);
    EXPECT_EQ(left.stamp_ns(), given.stamp_ns());
    EXPECT_EQ(left.depth_stamp_ns(), given.depth_stamp_ns());
    EXPECT_TRUE(left.prior().has_value());
    EXPECT_EQ(repeated.take_warning().empty(), i > 1) << "told once";
  }
  EXPECT_EQ(repeated.left_out(frame_at(0.5, 7, 2.5)).image()->depth(3, 3), 2.5F);
}

TEST(RepeatedDepth, OfACameraThatStandsStillWithoutNoiseIsKept) {
  RepeatedDepth repeated;
  for (int i = 0; i < 3; ++i) EXPECT_EQ(repeated.left_out(frame_at(0.1 * i, 1, 2)).image()->depth(3, 3), 2);
  EXPECT_EQ(repeated.take_warning(), "");
}

TEST(RepeatedDepth, OfAWallThatIsFacedWithoutNoiseIsKept) {
  RepeatedDepth repeated;
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(repeated.left_out(frame_at(0.1 * i, static_cast<uint8_t>(i), 2, 0)).image()->depth(3, 3), 2);
  EXPECT_EQ(repeated.take_warning(), "");
}

}  // namespace
}  // namespace dkb
