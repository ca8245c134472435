// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_image.h"

#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/image/image.h"
#include "dkb/recordings/bayer.h"
#include "dkb/recordings/message_list_test_tools.h"
#include "dkb/util/test_errors.h"

namespace dkb::test {
namespace {

constexpr int kRawWidth = 31, kRawHeight = 5;  // rows begin at odd bytes

RecordedImage read_raw(const std::string& bytes) {
  return read_recorded_image(bytes, "sensor_msgs/Image", MessageEncoding::ros1, "/image");
}
RecordedImage read_compressed(const std::string& bytes) {
  return read_recorded_image(bytes, "sensor_msgs/CompressedImage", MessageEncoding::ros1, "/image");
}

std::string raw(const std::string& encoding, const std::string& data) {
  return encode(image_message(7, encoding, kRawWidth, kRawHeight, data));
}
std::string compressed(const std::string& format, const std::string& data) {
  CompressedImageMessage message;
  message.header.stamp_ns = 7, message.format = format, message.data = data;
  return encode(message);
}

// The pixels with `channels` bytes each, red first or last, `padding` bytes after each row.
std::string laid_out(const ColourImage& image, size_t channels, bool blue_first, size_t padding) {
  std::string data;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const Rgb p = image(x, y);
      data += static_cast<char>(blue_first ? p.b : p.r);
      data += static_cast<char>(p.g);
      data += static_cast<char>(blue_first ? p.r : p.b);
      data.append(channels - 3, '\x55');
    }
    data.append(padding, '\x77');
  }
  return data;
}

TEST(RecordedImage, ColourIsThatOfAFileInWhateverWayItIsStored) {
  const ColourImage image = noise_picture(1, kRawWidth, kRawHeight);
  const Picture file = decode_picture(encode_png(image), "file");
  ASSERT_EQ(file.colour, image);
  const std::pair<const char*, std::string> stored[] = {
      {"rgb8", laid_out(image, 3, false, 0)},  {"bgr8", laid_out(image, 3, true, 0)},
      {"rgba8", laid_out(image, 4, false, 0)}, {"bgra8", laid_out(image, 4, true, 0)},
      {"rgb8", laid_out(image, 3, false, 11)}, {"bgra8", laid_out(image, 4, true, 3)},
      {"8UC3", laid_out(image, 3, true, 0)},   {"8UC4", laid_out(image, 4, true, 0)},
  };
  for (const auto& [encoding, data] : stored) {
    const std::string bytes = raw(encoding, data);
    const Picture picture = picture_of(read_raw(bytes));
    EXPECT_EQ(picture.colour, file.colour) << encoding;
    EXPECT_EQ(picture.grey, file.grey) << encoding;
  }
  const std::string png = compressed("bgr8; png compressed bgr8", encode_png(image));
  EXPECT_EQ(picture_of(read_compressed(png)).grey, file.grey);
  const std::string jpeg = encode_jpeg(image);
  const std::string message = compressed("jpeg", jpeg);
  EXPECT_EQ(picture_of(read_compressed(message)).grey, decode_picture(jpeg, "file").grey);
}

TEST(RecordedImage, GreyHasNoColour) {
  GreyImage grey(kRawWidth, kRawHeight);
  for (size_t i = 0; i < grey.size(); ++i) grey.data()[i] = static_cast<uint8_t>(i);
  for (const char* encoding : {"mono8", "8UC1"}) {
    const std::string bytes = raw(encoding, {reinterpret_cast<const char*>(grey.data()), grey.size()});
    const Picture picture = picture_of(read_raw(bytes));
    EXPECT_EQ(picture.grey, grey);
    EXPECT_TRUE(picture.colour.empty());
  }
}

TEST(RecordedImage, DepthIsThatOfAFileInWhateverWayItIsStored) {
  Camera camera = small_camera();
  camera.depth_factor = 1000;
  const Image<uint16_t> units = noise_depth(2, kRawWidth, kRawHeight);
  const std::string png = encode_png(units);
  const DepthImage file = decode_depth(png, "file", camera);
  camera.depth_factor = 5000;  // integers in messages are millimetres whatever the camera says
  const std::string little = bytes_of(units);
  std::string big = little;
  for (size_t i = 0; i < big.size(); i += 2) std::swap(big[i], big[i + 1]);
  std::string floats = metres_of(units, 1000), big_floats = floats;
  for (size_t i = 0; i < floats.size(); i += 4)
    std::reverse(big_floats.begin() + static_cast<long>(i), big_floats.begin() + static_cast<long>(i) + 4);
  for (const auto& [encoding, data, is_big] :
       {std::tuple("16UC1", little, false), std::tuple("mono16", little, false), std::tuple("16UC1", big, true),
        std::tuple("32FC1", floats, false), std::tuple("32FC1", big_floats, true)}) {
    ImageMessage message = image_message(7, encoding, kRawWidth, kRawHeight, data);
    message.is_bigendian = is_big;
    const std::string bytes = encode(message);
    const RecordedImage image = read_raw(bytes);
    EXPECT_EQ(image.content, ImageContent::depth);
    EXPECT_EQ(depth_of(image, camera), file) << encoding << is_big;
  }
  for (const auto& [format, data] : {std::pair("16UC1; compressedDepth png", std::string(12, '\0') + png),
                                     std::pair("16UC1; compressedDepth", std::string(12, '\0') + png),
                                     std::pair("16UC1; png compressed", png), std::pair("png", png)}) {
    const std::string bytes = compressed(format, data);
    EXPECT_EQ(depth_of(read_compressed(bytes), camera), file) << format;
  }
}

TEST(RecordedImage, FloatsThatAreNoDepthBecomeZero) {
  const float values[] = {
      std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1, 0.1f, 2, 11};
  const std::string data(reinterpret_cast<const char*>(values), sizeof values);
  const std::string bytes = encode(image_message(7, "32FC1", 6, 1, data));
  const DepthImage depth = depth_of(read_raw(bytes), small_camera());
  for (int x = 0; x < 6; ++x) EXPECT_EQ(depth(x, 0), x == 4 ? 2 : 0) << x;
}

// compressedDepth of floats keeps a / z + b: with a = 100 and b = 5 two metres are 55.
TEST(RecordedImage, InverseDepthIsUndone) {
  const float parameters[] = {100, 5};
  std::string data(4, '\0');
  data.append(reinterpret_cast<const char*>(parameters), sizeof parameters);
  Image<uint16_t> values(2, 1, 55);
  values(1, 0) = 0;
  const std::string bytes = compressed("32FC1; compressedDepth png", data + encode_png(values));
  const DepthImage depth = depth_of(read_compressed(bytes), small_camera());
  EXPECT_EQ(depth(0, 0), 2);
  EXPECT_EQ(depth(1, 0), 0);
}

TEST(RecordedImage, OtherEncodingsAreUnknown) {
  EXPECT_EQ(read_raw(raw("yuv422", std::string(2 * kRawWidth * kRawHeight, 0))).content, ImageContent::unknown);
  EXPECT_EQ(read_compressed(compressed("16UC1; compressedDepth rvl", std::string(40, 0))).content,
            ImageContent::unknown);
  EXPECT_EQ(input_error_of([] { picture_of(read_raw(raw("yuv422", ""))); }),
            "/image at 0.000000007: is no colour image (yuv422)");
}

TEST(RecordedImage, MessagesThatContradictThemselvesAreRefused) {
  const std::string row(3 * kRawWidth, 0);
  EXPECT_EQ(input_error_of([&] { read_raw(raw("rgb8", row)); }),
            "/image at 0.000000007: its rows of 18 bytes are too short");
  ImageMessage message = image_message(7, "rgb8", kRawWidth, kRawHeight, row);
  message.step = 3 * kRawWidth;
  EXPECT_EQ(input_error_of([&] { read_raw(encode(message)); }), "/image at 0.000000007: is truncated");
  message.width = message.height = message.step = 0xFFFFFFFF;
  EXPECT_NE(input_error_of([&] { read_raw(encode(message)); }).find("4294967295x4294967295 px"), std::string::npos);
  EXPECT_NE(input_error_of([] { read_raw("abc"); }).find("/image: a message is broken"), std::string::npos);
  EXPECT_EQ(input_error_of([] { read_compressed(compressed("16UC1; compressedDepth", "abc")); }),
            "/image at 0.000000007: is truncated");
}

TEST(RecordedImage, SurvivesMutatedMessages) {
  const ColourImage image = noise_picture(1, kRawWidth, kRawHeight);
  const std::string depth_png = std::string(12, '\x40') + encode_png(noise_depth(2, kRawWidth, kRawHeight));
  const std::string raws[] = {raw("bgr8", laid_out(image, 3, true, 2)),
                              raw("bayer_rggb8", std::string(kRawWidth * kRawHeight, 'a')),
                              raw("16UC1", bytes_of(noise_depth(2, kRawWidth, kRawHeight)))};
  const std::string files[] = {compressed("jpeg", encode_jpeg(image)), compressed("png", encode_png(image)),
                               compressed("16UC1; compressedDepth png", depth_png),
                               compressed("32FC1; compressedDepth png", depth_png)};
  Random random(11);
  const auto attempt = [&](const RecordedImage& opened) {
    if (opened.content == ImageContent::colour) picture_of(opened);
    if (opened.content == ImageContent::depth) depth_of(opened, small_camera());
  };
  for (int round = 0; round < 800; ++round) {
    for (const std::string& original : raws) {
      const std::string bytes = mutated(original, random);
      input_error_of([&] { attempt(read_raw(bytes)); });
    }
    for (const std::string& original : files) {
      const std::string bytes = mutated(original, random);
      input_error_of([&] { attempt(read_compressed(bytes)); });
    }
  }
}

// A picture whose channels are planes is given back exactly inside: the mean of neighbours is the value between them.
TEST(Demosaicing, GivesPlanesBackInside) {
  ColourImage plane(12, 10);
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 12; ++x)
      plane(x, y) = {static_cast<uint8_t>(10 + 4 * x + 2 * y), static_cast<uint8_t>(200 - 2 * x - 4 * y),
                     static_cast<uint8_t>(50 + 6 * y)};
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"}) {
    std::string mosaic;
    for (int y = 0; y < 10; ++y) {
      for (int x = 0; x < 12; ++x) {
        const char filter = pattern[static_cast<size_t>(2 * (y % 2) + x % 2)];
        const Rgb p = plane(x, y);
        mosaic += static_cast<char>(filter == 'r' ? p.r : filter == 'g' ? p.g : p.b);
      }
      mosaic += "--";
    }
    const ColourImage image = demosaiced(reinterpret_cast<const uint8_t*>(mosaic.data()), 12, 10, 14, pattern);
    for (int y = 1; y < 9; ++y)
      for (int x = 1; x < 11; ++x) EXPECT_EQ(image(x, y), plane(x, y)) << pattern << " " << x << " " << y;
    ImageMessage message = image_message(7, "bayer_" + pattern + "8", 12, 10, mosaic);
    const std::string bytes = encode(message);
    EXPECT_EQ(picture_of(read_raw(bytes)).colour, image);
  }
}

}  // namespace
}  // namespace dkb::test
