// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/v4l2_device.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/devices/v4l2_formats.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

TEST(V4l2Place, TwoDevicesByPathOrNumber) {
  const V4l2Place place = parse_v4l2_place("v4l2:/dev/video4,2");
  EXPECT_EQ(place.colour, "/dev/video4");
  EXPECT_EQ(place.depth, "/dev/video2");
  for (const std::string wrong : {"v4l2", "v4l2:", "v4l2:/dev/video0", "v4l2:1,", "v4l2:,1", "v4l2:1,2,3"})
    EXPECT_NE(test::input_error_of([&] { parse_v4l2_place(wrong); }).find(": must be v4l2:COLOUR,DEPTH"),
              std::string::npos)
        << wrong;
  EXPECT_EQ(test::input_error_of([&] { parse_v4l2_place("v4l2:1,1"); }),
            "v4l2:1,1: colour and depth must come from two video devices");
}

TEST(V4l2Pairs, ColourComesBeforeInfraredWhateverTheNumbers) {
  const std::vector<uint32_t> depth{V4L2_PIX_FMT_Z16}, infrared{V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_UYVY},
      colour{V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
  const std::vector<V4l2Node> nodes{{"/dev/video10", "usb-1", infrared}, {"/dev/video12", "usb-1", colour},
                                    {"/dev/video8", "usb-1", depth},     {"/dev/video0", "usb-2", colour},
                                    {"/dev/video2", "usb-3", infrared},  {"/dev/video4", "usb-3", depth},
                                    {"/dev/video6", "usb-4", depth},     {"/dev/video7", "usb-5", {0x12345678}}};
  EXPECT_EQ(v4l2_pairs(nodes), (std::vector<std::string>{"v4l2:/dev/video2,/dev/video4", "v4l2:COLOUR,/dev/video6",
                                                         "v4l2:/dev/video12,/dev/video8"}));
  // The infrared camera's number is the higher one.
  EXPECT_EQ(v4l2_pairs({{"/dev/video9", "a", colour}, {"/dev/video10", "a", infrared}, {"/dev/video4", "a", depth}}),
            std::vector<std::string>{"v4l2:/dev/video9,/dev/video4"});
}

TEST(V4l2Place, MutatedPlacesThrowNothingButInputErrors) {
  Random random(23);
  for (int i = 0; i < 3000; ++i) {
    try {
      parse_v4l2_place(mutated("v4l2:/dev/video4,/dev/video2", random));
    } catch (const InputError&) {
    }
  }
}

TEST(V4l2Device, MissingCameraAndMissingDevicesAreNamedWithTheRemedy) {
  EXPECT_EQ(test::input_error_of([] { open_v4l2_device("v4l2:98,99", {}); }),
            "v4l2:98,99: video devices do not tell their intrinsics; give --camera FILE");
  SourceOptions options;
  options.camera = "fr1";
  EXPECT_EQ(test::input_error_of([&] { open_v4l2_device("v4l2:/no/camera,99", options); }),
            "/no/camera: No such file or directory; is the camera plugged in, and are you in the group video?");
  EXPECT_EQ(test::input_error_of([&] { open_v4l2_device("v4l2:/dev/null,99", options); }),
            "/dev/null: is no video device that streams; `v4l2-ctl --list-devices` names those that do");
}

TEST(V4l2Formats, YuyvFollowsBt601) {
  // White, black; then red (81, 90, 240) twice.
  const std::vector<uint8_t> bytes{235, 128, 16, 128, 81, 90, 81, 240};
  std::vector<uint8_t> scratch;
  const ImageView view = v4l2_image(V4l2Pixels::yuyv, bytes.data(), bytes.size(), 4, 1, 0, &scratch, "x");
  EXPECT_EQ(view.format, PixelFormat::rgb8);
  EXPECT_EQ(scratch, (std::vector<uint8_t>{255, 255, 255, 0, 0, 0, 255, 0, 0, 255, 0, 0}));
}

TEST(V4l2Formats, RowsMayBePadded) {
  const std::vector<uint8_t> bytes(2 * 10);
  std::vector<uint8_t> scratch;
  const ImageView view = v4l2_image(V4l2Pixels::z16, bytes.data(), bytes.size(), 4, 2, 10, &scratch, "x");
  EXPECT_EQ(view.stride, 10u);
  EXPECT_EQ(view.data, bytes.data()) << "nothing is copied";
}

TEST(V4l2Formats, BuffersThatAreTooShortAreRefused) {
  const std::vector<uint8_t> bytes(100);
  std::vector<uint8_t> scratch;
  for (const V4l2Pixels pixels : {V4l2Pixels::rgb24, V4l2Pixels::yuyv, V4l2Pixels::grey, V4l2Pixels::z16})
    EXPECT_EQ(test::input_error_of(
                  [&] { v4l2_image(pixels, bytes.data(), bytes.size(), 640, 480, 0, &scratch, "/dev/video0"); }),
              "/dev/video0: an image of 100 bytes is too short for 640x480 px");
}

TEST(V4l2Formats, AMutatedJpegThrowsNothingButInputErrors) {
  const std::string jpeg = encode_jpeg(ColourImage(16, 16, Rgb{10, 200, 30}));
  std::vector<uint8_t> scratch;
  const auto decode = [&](const std::string& bytes) {
    return v4l2_image(V4l2Pixels::mjpeg, reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), 16, 16, 0,
                      &scratch, "/dev/video0");
  };
  EXPECT_EQ(decode(jpeg).format, PixelFormat::rgb8);
  Random random(29);
  for (int i = 0; i < 1000; ++i) {
    try {
      decode(mutated(jpeg, random));
    } catch (const InputError&) {
    }
  }
}

TEST(V4l2Formats, NamesAreV4l2s) {
  V4l2Pixels pixels{};
  EXPECT_TRUE(v4l2_pixels_of(V4L2_PIX_FMT_Z16, &pixels));
  EXPECT_EQ(pixels, V4l2Pixels::z16);
  EXPECT_EQ(fourcc_of(V4l2Pixels::yuyv), static_cast<uint32_t>(V4L2_PIX_FMT_YUYV));
  EXPECT_FALSE(v4l2_pixels_of(V4L2_PIX_FMT_H264, &pixels));
}

}  // namespace
}  // namespace dkb
