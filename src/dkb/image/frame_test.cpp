// SPDX-License-Identifier: Apache-2.0
#include "dkb_slam/frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "dkb/image/image.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

constexpr int kWidth = 24, kHeight = 18;

Camera small_camera() {
  Camera camera;
  camera.width = kWidth, camera.height = kHeight;
  camera.depth_min = 0.2, camera.depth_max = 10;
  return camera;
}

// Rows of `stride` bytes that begin at an odd address; what lies between them must not be read.
struct Buffer {
  Buffer(PixelFormat format, size_t padding)
      : stride(padding + static_cast<size_t>(kWidth * bytes_per_pixel(format))),
        bytes(1 + stride * (kHeight - 1) + stride - padding, 0xEE),
        view{bytes.data() + 1, kWidth, kHeight, stride, format} {}
  uint8_t* at(int x, int y) {
    return bytes.data() + 1 + static_cast<size_t>(y) * stride + static_cast<size_t>(x * bytes_per_pixel(view.format));
  }
  template <class T>
  void put(int x, int y, T value) {
    std::memcpy(at(x, y), &value, sizeof value);
  }
  size_t stride;
  std::vector<uint8_t> bytes;  // not a byte more than the view may touch
  ImageView view;
};

class FrameTest : public ::testing::Test {
 protected:
  FrameTest() {
    Random random(3);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        rgb.put(x, y,
                Rgb{static_cast<uint8_t>(random.below(256)), static_cast<uint8_t>(random.below(256)),
                    static_cast<uint8_t>(random.below(256))});
        depth.put<uint16_t>(x, y, static_cast<uint16_t>(random.below(60000)));
      }
  }
  Rgb colour_at(int x, int y) {
    Rgb c;
    std::memcpy(&c, rgb.at(x, y), sizeof c);
    return c;
  }
  FrameInput input() const {
    FrameInput in;
    in.stamp_ns = 5'000'000'000;
    in.colour = rgb.view;
    in.depth = depth.view;
    return in;
  }
  std::string error_of(const FrameInput& in) const {
    return test::input_error_of([&] { Frame(camera, in); });
  }

  Camera camera = small_camera();
  Buffer rgb{PixelFormat::rgb8, 7}, depth{PixelFormat::depth_u16, 3};
};

TEST_F(FrameTest, EveryColourFormatGivesTheSameImage) {
  const Frame expected(camera, input());
  for (const PixelFormat format : {PixelFormat::bgr8, PixelFormat::rgba8, PixelFormat::bgra8}) {
    for (const size_t padding : {0, 1, 40}) {
      Buffer other(format, padding);
      const bool blue_first = format != PixelFormat::rgba8;
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
          const Rgb c = colour_at(x, y);
          uint8_t* p = other.at(x, y);
          p[0] = blue_first ? c.b : c.r, p[1] = c.g, p[2] = blue_first ? c.r : c.b;
        }
      FrameInput in = input();
      in.colour = other.view;
      const Frame frame(camera, in);
      EXPECT_EQ(frame.image()->colour, expected.image()->colour) << name_of(format);
      EXPECT_EQ(frame.image()->grey, expected.image()->grey) << name_of(format);
    }
  }
  EXPECT_EQ(expected.image()->colour(3, 2), colour_at(3, 2));
  EXPECT_EQ(expected.image()->grey, grey_from_colour(expected.image()->colour));
}

TEST_F(FrameTest, GreyCamerasHaveNoColour) {
  Buffer grey(PixelFormat::grey8, 5);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) *grey.at(x, y) = static_cast<uint8_t>(10 * y + x);
  FrameInput in = input();
  in.colour = grey.view;
  const Frame frame(camera, in);
  EXPECT_TRUE(frame.colour().empty());
  ASSERT_FALSE(frame.grey().empty());
  for (int y = 0; y < kHeight; ++y) EXPECT_EQ(std::memcmp(frame.grey().row(y), grey.at(0, y), kWidth), 0);
}

TEST_F(FrameTest, AStrideOfZeroMeansPackedRows) {
  Buffer packed(PixelFormat::depth_u16, 0);
  for (int y = 0; y < kHeight; ++y) std::memcpy(packed.at(0, y), depth.at(0, y), 2 * kWidth);
  FrameInput in = input();
  in.depth = packed.view;
  in.depth.stride = 0;
  EXPECT_EQ(Frame(camera, in).image()->depth, Frame(camera, input()).image()->depth);
}

TEST_F(FrameTest, IntegerDepthIsTheFloatNearestToItsMetres) {
  camera.width = camera.height = 256;
  camera.depth_min = 0, camera.depth_max = 100;
  std::vector<uint16_t> units(256 * 256);
  for (size_t i = 0; i < units.size(); ++i) units[i] = static_cast<uint16_t>(i);
  const std::vector<uint8_t> grey(256 * 256);
  FrameInput in;
  in.colour = {grey.data(), 256, 256, 0, PixelFormat::grey8};
  in.depth = {units.data(), 256, 256, 0, PixelFormat::depth_u16};
  for (const double factor : {5000.0, 1000.0, 1000.1, 999.0, 6553.5}) {
    camera.depth_factor = factor;
    const Frame frame(camera, in);
    for (size_t i = 0; i < units.size(); ++i) {
      const auto exact = static_cast<long double>(units[i]) / static_cast<long double>(factor);
      ASSERT_EQ(frame.image()->depth.data()[i], static_cast<float>(exact)) << units[i] << " / " << factor;
    }
  }
}

TEST_F(FrameTest, FloatDepthThatSaysTheSameGivesTheSameImage) {
  const Frame of_units(camera, input());
  Buffer metres(PixelFormat::depth_f32, 5);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      uint16_t units = 0;
      std::memcpy(&units, depth.at(x, y), sizeof units);
      metres.put(x, y, static_cast<float>(units / camera.depth_factor));
    }
  FrameInput in = input();
  in.depth = metres.view;
  EXPECT_EQ(Frame(camera, in).image()->depth, of_units.image()->depth);
}

TEST_F(FrameTest, DepthOutsideTheCamerasRangeIsNone) {
  Buffer metres(PixelFormat::depth_f32, 0);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const float values[] = {0, -1, nan, infinity, -infinity, 0.19f, 10.1f, 0.2f, 10, 3.5f};
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) metres.put(x, y, 0.0f);
  for (int i = 0; i < 10; ++i) metres.put(i, 4, values[i]);
  FrameInput in = input();
  in.depth = metres.view;
  const Frame frame(camera, in);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(frame.image()->depth(i, 4), i < 7 ? 0 : values[i]) << values[i];
}

TEST(Frame, TheCamerasMaskHasNoDepth) {
  Camera camera = small_camera();
  auto mask = std::make_shared<Image<uint8_t>>(kWidth, kHeight);
  (*mask)(3, 2) = 1;
  camera.mask = mask;
  const Image<float> depth(kWidth, kHeight, 1.5f);
  const Image<uint8_t> grey(kWidth, kHeight);
  const FrameInput input{.colour = {grey.data(), kWidth, kHeight, 0, PixelFormat::grey8},
                         .depth = {depth.data(), kWidth, kHeight, 0, PixelFormat::depth_f32}};
  const Frame frame(camera, input);
  const DepthImage& seen = frame.image()->depth;
  EXPECT_EQ(seen(3, 2), 0);
  EXPECT_EQ(std::count(seen.data(), seen.data() + seen.size(), 1.5f), kWidth * kHeight - 1);
  camera.mask = std::make_shared<Image<uint8_t>>(kWidth, 1);
  EXPECT_NE(test::input_error_of([&] { Frame(camera, input); }).find("mask"), std::string::npos);
}

TEST_F(FrameTest, ViewsThatDoNotFitAreRefusedAndNamed) {
  const auto refused = [&](auto change, const char* says) {
    FrameInput in = input();
    change(in);
    EXPECT_NE(error_of(in).find(says), std::string::npos) << error_of(in);
  };
  refused([](auto& in) { in.colour = {}; }, "colour image: its data is null");
  refused([](auto& in) { in.depth.data = nullptr; }, "depth image: its data is null");
  refused([](auto& in) { in.colour.width = kWidth - 1; }, "colour image: it is of 23 x 18 px, the camera of 24 x 18");
  refused([](auto& in) { in.depth.height = 2 * kHeight; }, "depth image: it is of 24 x 36 px");
  refused([](auto& in) { in.colour.width = -kWidth; }, "colour image: it is of -24 x 18 px");
  refused([](auto& in) { in.colour.stride = 3 * kWidth - 1; },
          "colour image: its stride of 71 bytes is less than the 72");
  refused([](auto& in) { in.depth.stride = 1; }, "depth image: its stride of 1 bytes");
  refused([](auto& in) { in.colour.format = PixelFormat::depth_u16; }, "colour image: its format is depth_u16");
  refused([](auto& in) { in.depth.format = PixelFormat::grey8; }, "depth image: its format is grey8");
  refused([](auto& in) { in.colour.format = static_cast<PixelFormat>(99); }, "colour image: its format is unknown");
  refused([](auto& in) { in.depth.format = static_cast<PixelFormat>(-1); }, "depth image: its format is unknown");
  EXPECT_EQ(error_of(input()), "no error");
}

TEST_F(FrameTest, PriorsThatAreNoMotionAreRefused) {
  const auto refused = [&](auto change, const char* says) {
    MotionPrior prior;
    change(prior);
    FrameInput in = input();
    in.prior = prior;
    EXPECT_NE(error_of(in).find(says), std::string::npos) << error_of(in);
    Frame frame(camera, input());
    EXPECT_NE(test::input_error_of([&] { frame.set_prior(prior); }).find(says), std::string::npos);
    EXPECT_FALSE(frame.prior()) << "it stays as it was";
  };
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  refused([&](auto& p) { p.previous_from_current.translation.y() = nan; }, "motion prior: one of its numbers");
  refused([&](auto& p) { p.previous_from_current.rotation.w() = nan; }, "motion prior: one of its numbers");
  refused([&](auto& p) { p.previous_from_current.translation.x() = infinity; }, "motion prior: one of its numbers");
  refused([&](auto& p) { p.covariance(2, 3) = nan; }, "motion prior: one of its numbers");
  refused([&](auto& p) { p.previous_from_current.rotation.coeffs() *= 1.1; }, "motion prior: its rotation");
  refused([&](auto& p) { p.covariance(1, 1) = -0.1; }, "motion prior: its covariance");
  refused([&](auto& p) { p.covariance(0, 3) = p.covariance(3, 0) = 1.5; }, "motion prior: its covariance");
  Frame frame(camera, input());
  frame.set_prior(MotionPrior());
  EXPECT_TRUE(frame.prior());
  frame.set_prior({});
  EXPECT_FALSE(frame.prior());
}

TEST_F(FrameTest, StampsAreThoseOfTheInput) {
  FrameInput in = input();
  EXPECT_EQ(Frame(camera, in).depth_stamp_ns(), 5'000'000'000) << "the colour image's, unless told";
  in.depth_stamp_ns = 4'990'000'000;
  const Frame frame(camera, in);
  EXPECT_EQ(frame.stamp_ns(), 5'000'000'000);
  EXPECT_EQ(frame.depth_stamp_ns(), 4'990'000'000);
  EXPECT_EQ(frame.image()->timestamp, 5.0);
  EXPECT_EQ(frame.image()->depth_timestamp, 4.99);
}

TEST_F(FrameTest, CopiesShareTheImagesAndOutliveTheCallersBuffers) {
  Frame copy;
  EXPECT_TRUE(copy.empty());
  EXPECT_TRUE(copy.colour().empty() && copy.grey().empty() && copy.depth().empty());
  const Rgb before = colour_at(1, 1);
  {
    const Frame frame(camera, input());
    copy = frame;
    EXPECT_EQ(copy.colour().data, frame.colour().data);
  }
  rgb.put(1, 1, Rgb{1, 2, 3});
  EXPECT_EQ(copy.image()->colour(1, 1), before);
}

TEST(Frame, ADepthStampOfAnotherClockIsRefused) {
  const Camera camera = small_camera();
  const Buffer colour(PixelFormat::grey8, 0), depth(PixelFormat::depth_f32, 0);
  constexpr int64_t kStamp = 1'700'000'000'000'000'000;
  const auto made = [&](int64_t depth_stamp_ns) {
    return Frame(camera, {kStamp, colour.view, depth.view, depth_stamp_ns, {}});
  };
  EXPECT_EQ(made(kStamp - 199'000'000).depth_stamp_ns(), kStamp - 199'000'000);
  EXPECT_EQ(made(kStamp + 199'000'000).depth_stamp_ns(), kStamp + 199'000'000);
  for (const int64_t wrong : {int64_t{0}, kStamp - 201'000'000, kStamp + 201'000'000, kStamp / 1000,
                              std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max()})
    EXPECT_NE(test::input_error_of([&] { made(wrong); }).find("depth_stamp_ns"), std::string::npos) << wrong;
}

TEST(MotionPrior, JoinedOnesAreOneMotionAndItsCovarianceIsThatOfSamples) {
  const auto small = [](const Vector6d& v) {
    const Eigen::Vector3d w = v.tail<3>();
    const double angle = w.norm();
    return Rigid3(angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle)) : Eigen::Quaterniond::Identity(),
                  v.head<3>());
  };
  MotionPrior first, second;
  first.previous_from_current = small((Vector6d() << 0.4, -0.1, 0.7, 0.3, -0.5, 0.2).finished());
  second.previous_from_current = small((Vector6d() << 1.5, 0.3, -0.6, -0.4, 0.1, 0.6).finished());
  first.covariance = (Vector6d() << 1, 2, 3, 4, 5, 6).finished().asDiagonal();
  first.covariance *= 1e-8;
  second.covariance = Matrix6d::Identity() * 2e-8;
  const MotionPrior sum = joined(first, second);
  const Rigid3 expected = first.previous_from_current * second.previous_from_current;
  EXPECT_LT((sum.previous_from_current.translation - expected.translation).norm(), 1e-12);

  Matrix6d sampled = Matrix6d::Zero();
  for (int axis = 0; axis < 12; ++axis) {  // the covariance is a sum of what each axis does by itself
    Vector6d a = Vector6d::Zero(), b = Vector6d::Zero();
    (axis < 6 ? a[axis] : b[axis - 6]) =
        std::sqrt(axis < 6 ? first.covariance(axis, axis) : second.covariance(axis - 6, axis - 6));
    const Rigid3 moved = first.previous_from_current * small(a) * second.previous_from_current * small(b);
    const Rigid3 error = expected.inverse() * moved;
    const Eigen::AngleAxisd turn(error.rotation);
    Vector6d delta;
    delta << error.translation, turn.angle() * turn.axis();
    sampled += delta * delta.transpose();
  }
  EXPECT_LT((sum.covariance - sampled).norm(), 1e-3 * sampled.norm());
  EXPECT_FALSE(sum.rotation_only);
  second.rotation_only = true;
  EXPECT_TRUE(joined(first, second).rotation_only);
}

}  // namespace
}  // namespace dkb
