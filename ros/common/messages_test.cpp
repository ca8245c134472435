// SPDX-License-Identifier: Apache-2.0
// Messages as both ROS have them, by structs with the fields that are read.
#include "messages.h"

#include <gtest/gtest.h>

namespace dkb_ros {
namespace {

struct Vector {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Transform {
  Vector translation;
  Quaternion rotation;
};

struct Header {
  std::string frame_id = "/frame";
};
struct Image {
  Header header;
  std::string encoding = "rgb8";
  uint32_t width = 1, height = 1, step = 3;
  uint8_t is_bigendian = 0;
  std::vector<uint8_t> data = {1, 2, 3};
};
struct Imu {
  Header header;
  Vector angular_velocity;
  std::array<double, 9> angular_velocity_covariance{};
};
struct PoseWithCovariance {
  struct {
    Vector position;
    Quaternion orientation;
  } pose;
  std::array<double, 36> covariance{};
};
struct Odometry {
  Header header;
  std::string child_frame_id = "/child";
  PoseWithCovariance pose;
  struct {
    struct {
      Vector linear, angular;
    } twist;
    std::array<double, 36> covariance{};
  } twist;
};
struct Pose {
  Header header;
  PoseWithCovariance pose;
};

// TF looks up none that begins with a slash.
TEST(Messages, FramesHaveNoLeadingSlash) {
  const Image image;
  EXPECT_EQ(image_from(image, 0, nullptr).frame_id, "frame");
  EXPECT_EQ(imu_from(Imu(), 0).frame_id, "frame");
  EXPECT_EQ(odometry_from(Odometry(), 0).child_frame_id, "child");
  Pose pose;
  EXPECT_EQ(pose_with_covariance_from(pose, 0).frame_id, "frame");
  pose.header.frame_id = "";
  EXPECT_EQ(pose_with_covariance_from(pose, 0).frame_id, "");
}

TEST(Messages, TransformsAreRigidThoughTheirQuaternionIsNotOfLengthOne) {
  Transform m;
  m.translation = {1, 2, 3};
  m.rotation = {-0.502, 0.502, -0.502, 0.502};  // tf2 takes it
  const std::optional<Rigid3> rigid = rigid_from_transform(m);
  ASSERT_TRUE(rigid);
  EXPECT_NEAR(rigid->rotation.norm(), 1, 1e-12);
  EXPECT_LT(rigid->rotation.angularDistance(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)), 1e-9);
  EXPECT_EQ(rigid->translation, Eigen::Vector3d(1, 2, 3));
  m.rotation = {0, 0, 0, 0};
  EXPECT_FALSE(rigid_from_transform(m));
  m.rotation.w = NAN;
  EXPECT_FALSE(rigid_from_transform(m));
}

}  // namespace
}  // namespace dkb_ros
