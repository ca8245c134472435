// SPDX-License-Identifier: Apache-2.0
#include "inputs.h"

#include <gtest/gtest.h>

#include <random>

namespace dkb_ros {
namespace {

CameraInfoMessage info() {
  CameraInfoMessage info;
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.d = {0.1, -0.2, 0.001, 0.002, 0.3};
  info.k = {500, 0, 320, 0, 510, 240, 0, 0, 1};
  info.p = {480, 0, 321, 0, 0, 490, 241, 0, 0, 0, 1, 0};
  return info;
}

TEST(CameraInfo, GivesTheCameraOfRawAndOfRectifiedImages) {
  const dkb::Camera raw = camera_of(info(), false), rectified = camera_of(info(), true);
  EXPECT_EQ(raw.fx, 500);
  EXPECT_EQ(raw.cy, 240);
  EXPECT_EQ(raw.p2, 0.002);
  EXPECT_EQ(raw.k3, 0.3);
  EXPECT_EQ(rectified.fx, 480);
  EXPECT_EQ(rectified.cy, 241);
  EXPECT_FALSE(rectified.distorted());
}

TEST(CameraInfo, OtherModelsAndMissingCalibrationsAreRefused) {
  CameraInfoMessage other = info();
  other.distortion_model = "rational_polynomial", other.d.resize(12);  // as a recording may tell plumb_bob
  EXPECT_EQ(camera_of(other, false).k3, 0.3);
  other.d = {0.5, -2.6, 0.0007, -0.0002, 1.5, 0.38, -2.45, 1.43};  // Azure Kinect's
  EXPECT_EQ(camera_of(other, false).k6, 1.43);
  other.distortion_model = "", other.d = {0.1, 0, 0, 0.02};
  EXPECT_EQ(camera_of(other, false).p2, 0.02);
  other.distortion_model = "equidistant";
  EXPECT_THROW(camera_of(other, false), dkb::InputError);
  other.d = {0, 0, 0, 0};  // of no consequence without coefficients
  EXPECT_EQ(camera_of(other, false).k1, 0);
  CameraInfoMessage none = info();
  none.k = {};
  EXPECT_THROW(camera_of(none, false), dkb::InputError);
}

TEST(Image, WhateverAMessageClaimsNoByteOutsideOfItIsRead) {
  const std::vector<std::string> encodings = {"rgb8", "bgra8", "mono8", "16UC1", "32FC1", "8UC3", "bayer_rggb8", ""};
  const std::vector<uint8_t> bytes(5000);
  std::mt19937 random(1);
  int taken = 0;
  for (int i = 0; i < 5000; ++i) {
    ImageMessage m;
    m.encoding = encodings[random() % encodings.size()];
    m.width = static_cast<int>(random() % 70) - 3;
    m.height = static_cast<int>(random() % 40) - 3;
    m.step = random() % 3 == 0 ? random() : random() % 300;
    m.is_bigendian = random() % 4 == 0;
    m.data = bytes.data();
    m.size = random() % bytes.size();
    try {
      const dkb::ImageView view = view_of(m, random() % 2 == 0);
      ASSERT_GT(view.height, 0);
      ASSERT_LE(view.row(view.height - 1) + view.row_bytes(), m.data + m.size);
      ++taken;
    } catch (const dkb::InputError&) {
    }
  }
  EXPECT_GT(taken, 20);
}

}  // namespace
}  // namespace dkb_ros
