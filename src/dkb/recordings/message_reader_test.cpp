// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/message_reader.h"

#include <gtest/gtest.h>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

using namespace std::string_literals;

TEST(MessageReader, Ros1IsPackedAndLittleEndian) {
  const std::string in_bytes = "\x07\x01\x02\x03\x04\x02\x00\x00\x00hi\x00\x00\x00\x00\x00\x00\xF0\x3F"s;
  MessageReader in(in_bytes, MessageEncoding::ros1);
  EXPECT_EQ(in.u8(), 7);
  EXPECT_EQ(in.u32(), 0x04030201U);
  EXPECT_EQ(in.text(), "hi");
  EXPECT_EQ(in.f64(), 1.0);
  EXPECT_EQ(in.left(), 0U);
}

// Numbers are aligned to their own size, counted from the byte after the four that tell the representation.
TEST(MessageReader, CdrIsAligned) {
  const std::string in_bytes =
      "\x00\x01\x00\x00"
      "\x07\xFF\xFF\xFF\x01\x02\x03\x04"
      "\x03\x00\x00\x00hi\x00\xFF\x00\x00\x00\x00\x00\x00\xF0\x3F"s;
  MessageReader in(in_bytes, MessageEncoding::cdr);
  EXPECT_EQ(in.u8(), 7);
  EXPECT_EQ(in.u32(), 0x04030201U);
  EXPECT_EQ(in.text(), "hi");  // its size counts the zero
  EXPECT_EQ(in.f64(), 1.0);
  EXPECT_EQ(in.left(), 0U);
}

TEST(MessageReader, CdrMayBeBigEndian) {
  const std::string in_bytes = "\x00\x00\x00\x00\x01\x02\x03\x04\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFE"s;
  MessageReader in(in_bytes, MessageEncoding::cdr);
  EXPECT_EQ(in.u32(), 0x01020304U);
  const std::string stamp_bytes = "\x00\x00\x00\x00\x00\x00\x00\x02\x00\x00\x00\x07"s;
  MessageReader stamp(stamp_bytes, MessageEncoding::cdr);
  EXPECT_EQ(stamp.stamp_ns(), 2'000'000'007);
}

TEST(MessageReader, PlainCdr2AlignsToFourBytesAtMost) {
  const std::string in_bytes = "\x00\x07\x00\x00\x07\xFF\xFF\xFF\x00\x00\x00\x00\x00\x00\xF0\x3F"s;
  MessageReader in(in_bytes, MessageEncoding::cdr);
  in.u8();
  EXPECT_EQ(in.f64(), 1.0);
}

TEST(MessageReader, OtherRepresentationsAreRefusedByNumber) {
  EXPECT_NE(test::input_error_of([] {
              MessageReader("\x00\x03\x00\x00"s, MessageEncoding::cdr);
            }).find("representation is 3"),
            std::string::npos);
}

TEST(MessageReader, SecondsBefore1970AreRos2s) {
  const std::string bytes = "\xFF\xFF\xFF\xFF\x00\x00\x00\x00"s;
  EXPECT_EQ(MessageReader("\x00\x01\x00\x00"s + bytes, MessageEncoding::cdr).stamp_ns(), -1'000'000'000);
  EXPECT_EQ(MessageReader(bytes, MessageEncoding::ros1).stamp_ns(), 4294967295 * 1'000'000'000);
}

TEST(MessageReader, ClaimsOfMoreThanThereIsAreRefused) {
  EXPECT_THROW(MessageReader("\xFF\xFF\xFF\xFFhello"s, MessageEncoding::ros1).text(), InputError);
  EXPECT_THROW(MessageReader("\xFF\xFF\xFF\x7F"s, MessageEncoding::ros1).count(1), InputError);
  EXPECT_THROW(MessageReader("\x03\x00\x00\x00\x00\x00"s, MessageEncoding::ros1).count(1), InputError);
  EXPECT_THROW(MessageReader(""s, MessageEncoding::cdr), InputError);
}

HeaderMessage some_header() {
  return {1305031102'175304001, "camera", 3};
}

OdometryMessage some_odometry() {
  OdometryMessage m;
  m.header = some_header();
  m.child_frame_id = "base";
  m.pose = {{1, 2, 3}, {0.5, 0.5, -0.5, 0.5}};
  m.pose_covariance[35] = 7, m.twist_covariance[1] = -1;
  m.linear = {4, 5, 6}, m.angular = {7, 8, 9};
  return m;
}

CameraInfoMessage some_camera_info() {
  CameraInfoMessage m;
  m.header = some_header();
  m.height = 480, m.width = 640;
  m.distortion_model = "plumb_bob";
  m.d = {0.1, 0.2, 0.3, 0.4, 0.5};
  m.k = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  m.p[11] = 12;
  m.binning_y = 2, m.roi_width = 5, m.roi_do_rectify = true;
  return m;
}

TEST(RosMessages, WhatIsWrittenIsReadBack) {
  const OdometryMessage odometry = decode_odometry(encode(some_odometry()), MessageEncoding::ros1);
  EXPECT_EQ(odometry.header.stamp_ns, 1305031102'175304001);
  EXPECT_EQ(odometry.header.frame_id, "camera");
  EXPECT_EQ(odometry.child_frame_id, "base");
  EXPECT_EQ(odometry.pose.orientation.coeffs(), some_odometry().pose.orientation.coeffs());
  EXPECT_EQ(odometry.pose_covariance, some_odometry().pose_covariance);
  EXPECT_EQ(odometry.twist_covariance, some_odometry().twist_covariance);
  EXPECT_EQ(odometry.angular, some_odometry().angular);

  const CameraInfoMessage info = decode_camera_info(encode(some_camera_info()), MessageEncoding::ros1);
  EXPECT_EQ(info.d, some_camera_info().d);
  EXPECT_EQ(info.k, some_camera_info().k);
  EXPECT_EQ(info.p, some_camera_info().p);
  EXPECT_EQ(info.roi_width, 5U);
  EXPECT_TRUE(info.roi_do_rectify);

  ImageMessage image;
  image.header = some_header();
  image.height = 2, image.width = 3, image.encoding = "mono8", image.step = 3, image.data = "abcdef";
  const std::string bytes = encode(image);
  const ImageMessage back = decode_image(bytes, MessageEncoding::ros1);
  EXPECT_EQ(back.encoding, "mono8");
  EXPECT_EQ(back.step, 3U);
  EXPECT_EQ(back.data, "abcdef");
  EXPECT_GE(back.data.data(), bytes.data());  // not copied

  TransformMessage transform;
  transform.child_frame_id = "b";
  transform.transform.position = {1, 2, 3};
  EXPECT_EQ(decode_transforms(encode(TransformsMessage{transform, transform}), MessageEncoding::ros1)[1].child_frame_id,
            "b");
  EXPECT_EQ(decode_string(encode_string("fx: 1"), MessageEncoding::ros1), "fx: 1");
}

TEST(RosMessages, DefinitionsHoldTheTypesWithinThem) {
  const MessageDefinition path = message_definition("nav_msgs/Path");
  EXPECT_EQ(path.text.rfind("std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n====", 0), 0U) << path.text;
  for (const char* type : {"Point", "Quaternion", "Pose", "PoseStamped"})
    EXPECT_NE(path.text.find(std::string("\nMSG: geometry_msgs/") + type + "\n"), std::string::npos) << type;
}

TEST(RosMessages, BrokenBytesAreRefusedAndDoNothingWorse) {
  Random random(5);
  TransformMessage transform;
  transform.child_frame_id = "base";
  ImageMessage image;
  image.data = "pixels", image.encoding = "rgb8";
  CompressedImageMessage compressed;
  compressed.data = "pixels";
  const std::vector<std::string> messages = {encode(some_odometry()), encode(some_camera_info()),
                                             encode(image),           encode(compressed),
                                             encode_string("text"),   encode(TransformsMessage(3, transform))};
  int read = 0;
  for (int i = 0; i < 6000; ++i) {
    std::string bytes = messages[static_cast<size_t>(i) % messages.size()];
    const MessageEncoding encoding = i % 4 == 0 ? MessageEncoding::cdr : MessageEncoding::ros1;
    if (encoding == MessageEncoding::cdr) bytes.insert(0, i % 8 == 0 ? "\x00\x01\x00\x00"s : "\x00\x00\x00\x00"s);
    bytes = mutated(bytes, random);
    const auto attempt = [&](const auto& decode) {
      try {
        decode(bytes, encoding);
        ++read;
      } catch (const InputError&) {
      }
    };
    attempt(decode_image), attempt(decode_compressed_image), attempt(decode_camera_info), attempt(decode_odometry);
    attempt(decode_imu), attempt(decode_transforms), attempt(decode_string);
  }
  EXPECT_GT(read, 1000);
}

}  // namespace
}  // namespace dkb
