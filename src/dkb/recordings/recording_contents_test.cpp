// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_contents.h"

#include <gtest/gtest.h>

#include "dkb/recordings/message_list_test_tools.h"
#include "dkb/recordings/recorded_camera.h"
#include "dkb/recordings/static_transforms.h"
#include "dkb/util/test_errors.h"

namespace dkb::test {
namespace {

const Rigid3 kMount{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {0.05, 0, 0.01}};

RecordingContents contents_of(MessageList list, const SourceOptions& options = {}) {
  return look_into(list, options, "r.bag");
}
std::string refused(const MessageList& list, const SourceOptions& options = {}) {
  return input_error_of([&] { contents_of(list, options); });
}

void add_info(MessageList& list, const std::string& topic, const CameraInfoMessage& info) {
  list.add(topic, "sensor_msgs/CameraInfo", kFirst, info);
}
void add_transform(MessageList& list, const std::string& parent, const std::string& child, const Rigid3& transform) {
  list.add("/tf_static", "tf2_msgs/TFMessage", kFirst, TransformsMessage{transform_message(parent, child, transform)});
}

MessageList usual(const std::string& frame = "camera") {
  MessageList list;
  add_pairs(list, 0, 3, frame);
  add_info(list, "/rgb/camera_info", info_message(small_camera(), frame));
  return list;
}

TEST(RecordingContents, OneOfEachIsTakenByItsEncoding) {
  MessageList list = usual();
  list.add("/ir/image", "sensor_msgs/Image", kFirst, image_message(kFirst, "yuv422", 32, 24, std::string(1536, 0)));
  list.add_bytes("/points", "sensor_msgs/PointCloud2", kFirst, "");
  const RecordingContents contents = contents_of(list);
  EXPECT_EQ(contents.colour.name, "/rgb/image");
  EXPECT_EQ(contents.depth.name, "/depth/image");
  EXPECT_EQ(contents.camera_origin, "of /rgb/camera_info");
  EXPECT_EQ(contents.camera.fx, small_camera().fx);
  EXPECT_FALSE(contents.depth_camera);
  EXPECT_FALSE(contents.motion);
  EXPECT_TRUE(contents.stamped);
}

TEST(RecordingContents, SeveralAreListedWithTheOptionThatPicks) {
  MessageList list = usual();
  add_colour(list, 0, "camera", "/left/image"), add_depth(list, 0, "camera", "/far/image");
  EXPECT_EQ(refused(list),
            "r.bag: has several topics of colour images: /rgb/image (rgb8), /left/image (rgb8); pick one with "
            "--colour-topic");
  SourceOptions options;
  options.colour_topic = "/rgb/image";
  EXPECT_EQ(refused(list, options),
            "r.bag: has several topics of depth images: /depth/image (32FC1), /far/image (32FC1); pick one with "
            "--depth-topic");
  options.depth_topic = "/far/image";
  EXPECT_EQ(contents_of(list, options).depth.name, "/far/image");
  options.depth_topic = "/left/image";
  EXPECT_EQ(refused(list, options),
            "--depth-topic /left/image: r.bag has no depth images there; it has images on /rgb/image (rgb8), "
            "/depth/image (32FC1), /left/image (rgb8)");
}

TEST(RecordingContents, WhatIsMissingIsNamed) {
  MessageList list;
  EXPECT_EQ(refused(list),
            "r.bag: has no colour images (rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8, jpeg, png); it has no images at "
            "all");
  add_colour(list, 0);
  list.add("/ir/image", "sensor_msgs/Image", kFirst, image_message(kFirst, "8UC4", 32, 24, std::string(3072, 0)));
  EXPECT_EQ(refused(list),
            "r.bag: has no depth images (16UC1, mono16, 32FC1, compressedDepth); it has images on /rgb/image (rgb8), "
            "/ir/image (8UC4)");
  add_depth(list, 0);
  EXPECT_EQ(refused(list),
            "r.bag: the camera is not known: no CameraInfo belongs to /rgb/image; give --camera FILE, or fr1, fr2, "
            "fr3, bonn");
  add_info(list, "/other/camera_info", info_message(small_camera(), "elsewhere"));
  EXPECT_EQ(refused(list),
            "r.bag: the camera is not known: no CameraInfo belongs to /rgb/image; it has /other/camera_info; pick one "
            "with --info-topic, or give --camera FILE");
  SourceOptions options;
  options.info_topic = "/other/camera_info";
  EXPECT_EQ(contents_of(list, options).camera_origin, "of /other/camera_info");
  options.info_topic = "/no/camera_info";
  EXPECT_EQ(refused(list, options),
            "--info-topic /no/camera_info: r.bag has no CameraInfo there; it has /other/camera_info");
}

// All of a recording of a hundred pairs would be read, where the index and its first messages tell.
TEST(RecordingContents, WhatTheIndexTellsToBeMissingIsNotLookedFor) {
  MessageList no_depth;
  for (int n = 0; n < 100; ++n) add_colour(no_depth, n);
  EXPECT_THROW(look_into(no_depth, {}, "r.bag"), InputError);
  EXPECT_EQ(no_depth.farthest(), 1u);
  MessageList without_index(false);
  for (int n = 0; n < 100; ++n) add_colour(without_index, n);
  add_depth(without_index, 99), add_info(without_index, "/rgb/camera_info", info_message(small_camera()));
  EXPECT_NO_THROW(look_into(without_index, {}, "r.bag"));

  MessageList misspelt;
  add_pairs(misspelt, 0, 400);
  add_info(misspelt, "/rgb/camera_info", info_message(small_camera()));
  SourceOptions options;
  options.depth_topic = "/dpeth/image";
  EXPECT_EQ(input_error_of([&] { look_into(misspelt, options, "r.bag"); }),
            "--depth-topic /dpeth/image: r.bag has no depth images there; it has images on /rgb/image (rgb8), "
            "/depth/image (32FC1)");
  EXPECT_EQ(misspelt.farthest(), 2u);
  // One that is silent until late, or broken, is not waited for.
  misspelt.add_bytes("/ir/image", "sensor_msgs/Image", kFirst, "x");
  MessageList again = misspelt;
  again.rewind();
  EXPECT_THROW(look_into(again, options, "r.bag"), InputError);
  EXPECT_EQ(again.farthest(), 300u);
}

TEST(RecordingContents, AnInfoTopicGoesBeforeTheRecordingsTextAndMustBeThere) {
  MessageList list = usual();
  Camera own = small_camera();
  own.fx = 31;
  list.add_bytes("/dkb_slam/camera", "std_msgs/String", kFirst, encode_string(own.to_yaml()));
  SourceOptions options;
  options.info_topic = "/rgb/camera_info";
  EXPECT_EQ(contents_of(list, options).camera_origin, "of /rgb/camera_info");
  EXPECT_EQ(contents_of(list, options).camera.fx, small_camera().fx);
  options.info_topic = "/no/camera_info";
  const std::string error = "--info-topic /no/camera_info: r.bag has no CameraInfo there; it has /rgb/camera_info";
  EXPECT_EQ(refused(list, options), error);
  options.camera = "fr1";
  EXPECT_EQ(refused(list, options), error);
}

TEST(RecordingContents, ACameraIsFoundByItsFrame) {
  MessageList list;
  add_pairs(list, 0, 2, "/camera");
  add_info(list, "/info", info_message(small_camera(), "camera"));
  EXPECT_EQ(contents_of(list).camera_origin, "of /info");
}

TEST(RecordingContents, TheOptionsCameraGoesBeforeTheRecordingsOwnAndThatBeforeCameraInfo) {
  Camera own = small_camera();
  own.fx = 31, own.depth_factor = 5000, own.readout = 0.01;
  MessageList list = usual();
  list.add_bytes("/dkb_slam/camera", "std_msgs/String", kFirst, encode_string(own.to_yaml()));
  EXPECT_EQ(contents_of(list).camera_origin, "of /dkb_slam/camera");
  EXPECT_EQ(contents_of(list).camera.to_yaml(), own.to_yaml());
  SourceOptions options;
  options.camera = "fr1";
  EXPECT_EQ(contents_of(list, options).camera.width, 640);
  list.add_text("dkb_slam_camera", "fx: 1\n");
  EXPECT_NE(refused(list).find("r.bag: metadata dkb_slam_camera: key \"fy\" is missing"), std::string::npos);
}

TEST(RecordingContents, TheFallbackComesLast) {
  SourceOptions options;
  options.fallback_camera = Camera::named("fr2");
  EXPECT_EQ(contents_of(usual(), options).camera_origin, "of /rgb/camera_info");
  MessageList list;
  add_pairs(list, 0, 2);
  EXPECT_EQ(contents_of(list, options).camera_origin, "of the map");
}

TEST(RecordedCamera, OtherModelsOfDistortionAreRefusedByName) {
  CameraInfoMessage info = info_message(small_camera());
  info.distortion_model = "equidistant", info.d = {0.1, 0, 0, 0};
  EXPECT_EQ(input_error_of([&] { camera_of(info, false, "/info"); }),
            "/info: its distortion model equidistant is none of ours (plumb_bob, rational_polynomial); give the camera "
            "with --camera FILE, "
            "or rectified images");
  EXPECT_FALSE(camera_of(info, true, "/info").distorted()) << "rectified images have no distortion";
  info.distortion_model = "rational_polynomial", info.d = {0.1, 0.2, 0.03, 0.04, 0.5, 0, 0, 0};
  EXPECT_EQ(camera_of(info, false, "/info").k3, 0.5);
  info.d = {0.5, -2.6, 0.0007, -0.0002, 1.5, 0.38, -2.45, 1.43};  // Azure Kinect's
  EXPECT_EQ(camera_of(info, false, "/info").k6, 1.43);
  info.d[5] = -20;
  EXPECT_NE(input_error_of([&] {
              camera_of(info, false, "/info");
            }).find("/info: its coefficients of distortion give no ray at pixel (0, 0), as no lens does; give"),
            std::string::npos);
  info.distortion_model = "";
  info.d = {0.1, 0.2, 0.03, 0.04};
  EXPECT_EQ(camera_of(info, false, "/info").p2, 0.04);
  info.d = {0.1};
  EXPECT_NE(input_error_of([&] { camera_of(info, false, "/info"); }).find("1 coefficients"), std::string::npos);
  info.d = {}, info.k[0] = 0;
  EXPECT_NE(input_error_of([&] { camera_of(info, false, "/info"); }).find("not calibrated"), std::string::npos);
}

TEST(RecordedCamera, TopicsAreNamedAsInRos) {
  EXPECT_EQ(info_topic_of("/camera/rgb/image_color"), "/camera/rgb/camera_info");
  EXPECT_EQ(info_topic_of("/camera/rgb/image_color/compressed"), "/camera/rgb/camera_info");
  EXPECT_EQ(info_topic_of("/camera/depth/image_raw/compressedDepth"), "/camera/depth/camera_info");
  EXPECT_EQ(info_topic_of("/device_0/sensor_0/Depth_0/image/data"), "/device_0/sensor_0/Depth_0/info/camera_info")
      << "librealsense";
  EXPECT_TRUE(is_rectified("/camera/rgb/image_rect_color/compressed"));
  EXPECT_FALSE(is_rectified("/camera_rect/rgb/image_raw"));
}

TEST(RecordingContents, DepthOfAnotherViewIsToBeRegistered) {
  Camera depth_camera = small_camera();
  depth_camera.fx = depth_camera.fy = 40;
  MessageList list = usual();
  add_info(list, "/depth/camera_info", info_message(depth_camera, "camera"));
  const RecordingContents contents = contents_of(list);
  ASSERT_TRUE(contents.depth_camera);
  EXPECT_EQ(contents.depth_camera->camera.fx, 40);
  EXPECT_EQ(contents.depth_camera->colour_from_depth.translation.norm(), 0);
}

TEST(RecordingContents, DepthOfAnotherFrameIsToBeRegisteredByItsTransform) {
  MessageList list;
  add_colour(list, 0, "rgb"), add_depth(list, 0, "depth");
  add_info(list, "/rgb/camera_info", info_message(small_camera(), "rgb"));
  EXPECT_EQ(refused(list),
            "r.bag: depth on /depth/image (32x24) is not registered to the colour images on /rgb/image (32x24), and "
            "cannot be: there is no CameraInfo on /depth/camera_info; record registered depth (depth_registered, "
            "aligned_depth_to_color), or CameraInfo and /tf_static as well");
  add_info(list, "/depth/camera_info", info_message(small_camera(), "depth"));
  EXPECT_NE(refused(list).find("cannot be: /tf_static does not link depth with rgb;"), std::string::npos);
  MessageList same = list;
  add_transform(same, "rgb", "depth", {});
  EXPECT_FALSE(contents_of(same).depth_camera) << "two names of one place";
  add_transform(list, "base", "rgb", kMount), add_transform(list, "base", "depth", {});
  const RecordingContents contents = contents_of(list);
  ASSERT_TRUE(contents.depth_camera);
  EXPECT_TRUE(contents.depth_camera->colour_from_depth.translation.isApprox(kMount.inverse().translation));
}

// As the RealSense Viewer records: whatever took the images, their frame is "0".
TEST(RecordingContents, OneNumberForAllFramesDoesNotMakeDepthRegistered) {
  const std::string sensor = "/device_0/sensor_";
  MessageList list;
  add_colour(list, 0, "0", sensor + "1/Color_0/image/data"), add_depth(list, 0, "0", sensor + "0/Depth_0/image/data");
  add_info(list, sensor + "1/Color_0/info/camera_info", info_message(small_camera(), "0"));
  Camera depth_camera = small_camera();
  depth_camera.fx = depth_camera.fy = 40;
  MessageList same_view = list;
  add_info(list, sensor + "0/Depth_0/info/camera_info", info_message(depth_camera, "0"));
  EXPECT_NE(
      refused(list).find("is not registered to the colour images on /device_0/sensor_1/Color_0/image/data (32x24), "
                         "and cannot be: their headers name no frames;"),
      std::string::npos);
  add_info(same_view, sensor + "0/Depth_0/info/camera_info", info_message(small_camera(), "0"));
  EXPECT_EQ(contents_of(same_view).camera_origin, "of /device_0/sensor_1/Color_0/info/camera_info");
}

TEST(RecordingContents, DepthOfAnotherSizeWithoutFramesIsRefused) {
  MessageList list;
  add_colour(list, 0), add_depth(list, 0, "", "/depth/image", 24, 20);
  add_info(list, "/rgb/camera_info", info_message(small_camera()));
  Camera half = small_camera();
  half.width = 24, half.height = 20;
  add_info(list, "/depth/camera_info", info_message(half));
  EXPECT_NE(refused(list).find("(24x20) is not registered to the colour images on /rgb/image (32x24), and cannot be: "
                               "their headers name no frames"),
            std::string::npos);
}

class MotionOfARecording : public testing::Test {
 protected:
  MotionOfARecording() : list(usual()) {
    odometry.header = {kFirst, "odom", 0}, odometry.child_frame_id = "base";
    list.add("/odom", "nav_msgs/Odometry", kFirst, odometry);
  }
  SourceOptions with(PriorKind prior) const {
    SourceOptions options;
    options.prior = prior;
    return options;
  }
  MessageList list;
  OdometryMessage odometry;
};

TEST_F(MotionOfARecording, IsTakenWithThePlaceOfTheCamera) {
  add_transform(list, "base", "camera", kMount);
  const RecordingContents contents = contents_of(list);
  ASSERT_TRUE(contents.motion);
  EXPECT_EQ(contents.motion->name, "/odom");
  EXPECT_TRUE(contents.motion->body_from_cam.translation.isApprox(kMount.translation));
  EXPECT_TRUE(contents.warnings.empty());
  EXPECT_FALSE(contents_of(list, with(PriorKind::none)).motion);
}

TEST_F(MotionOfARecording, WithoutThePlaceOfTheCameraIsTakenForItsOwnOnlyWhenAskedFor) {
  const std::string unlinked =
      "r.bag: /tf_static does not link the frame of /odom (base) with the camera's (camera); the motion is ";
  const RecordingContents by_itself = contents_of(list);
  EXPECT_FALSE(by_itself.motion);
  EXPECT_EQ(by_itself.warnings,
            std::vector<std::string>{unlinked + "left out; --prior odom takes it for the camera's own"});
  const RecordingContents asked = contents_of(list, with(PriorKind::odometry));
  ASSERT_TRUE(asked.motion);
  EXPECT_EQ(asked.motion->body_from_cam.translation.norm(), 0);
  EXPECT_EQ(asked.warnings, std::vector<std::string>{unlinked + "taken for the camera's own"});
}

TEST_F(MotionOfARecording, OfAnInertialUnitThatIsLinkedGoesBeforeOdometryThatIsNot) {
  ImuMessage imu;
  imu.header = {kFirst, "camera", 0};
  list.add("/imu", "sensor_msgs/Imu", kFirst, imu);
  const RecordingContents contents = contents_of(list);
  ASSERT_TRUE(contents.motion);
  EXPECT_EQ(contents.motion->name, "/imu");
  EXPECT_TRUE(contents.motion->inertial);
  ASSERT_EQ(contents.warnings.size(), 1u);
  EXPECT_NE(contents.warnings[0].find("the frame of /odom (base)"), std::string::npos) << contents.warnings[0];
}

TEST_F(MotionOfARecording, ThatWasAskedForMustBeThere) {
  EXPECT_EQ(refused(list, with(PriorKind::imu)),
            "r.bag: has no sensor_msgs/Imu with angular rates; leave --prior out, or give --prior-file FILE");
  list.add("/wheels", "nav_msgs/Odometry", kFirst, odometry);
  const std::string several =
      "r.bag: has several topics of nav_msgs/Odometry: /odom, /wheels; pick one with --odom-topic";
  EXPECT_EQ(refused(list, with(PriorKind::odometry)), several);
  EXPECT_EQ(contents_of(list).warnings, std::vector<std::string>{several});
  SourceOptions options;
  options.odom_topic = "/wheels";
  EXPECT_EQ(contents_of(list, options).motion->name, "/wheels");
  options.odom_topic = "/no";
  EXPECT_EQ(refused(list, options), "--odom-topic /no: r.bag has no nav_msgs/Odometry there; it has /odom, /wheels");
}

TEST_F(MotionOfARecording, ATopicThatWouldNotBeReadIsRefused) {
  const auto error = [&](PriorKind prior, const std::string& odom, const std::string& imu) {
    SourceOptions options = with(prior);
    options.odom_topic = odom, options.imu_topic = imu;
    return refused(list, options);
  };
  EXPECT_EQ(error(PriorKind::odometry, "", "/imu"),
            "--imu-topic /imu: --prior odom reads no inertial unit; leave one of them out");
  EXPECT_EQ(error(PriorKind::imu, "/odom", ""),
            "--odom-topic /odom: --prior imu reads no odometry; leave one of them out");
  EXPECT_EQ(error(PriorKind::none, "/odom", ""),
            "--odom-topic /odom: --prior none reads no topic; leave one of them out");
  EXPECT_EQ(error(PriorKind::automatic, "/odom", "/imu"),
            "--odom-topic /odom: --imu-topic names another motion, and one is used; leave one of them out");
}

TEST(RecordingContents, AnInertialUnitWithoutAGyroscopeIsNoMotion) {
  MessageList list = usual();
  ImuMessage imu;
  imu.header = {kFirst, "camera", 0}, imu.angular_velocity_covariance[0] = -1;
  list.add("/accel", "sensor_msgs/Imu", kFirst, imu);
  EXPECT_FALSE(contents_of(list).motion);
  SourceOptions options;
  options.imu_topic = "/accel";
  EXPECT_EQ(refused(list, options), "--imu-topic /accel: tells no angular rates (covariance -1); pick another");
  options.imu_topic = "", options.prior = PriorKind::imu;
  EXPECT_EQ(refused(list, options),
            "r.bag: has no sensor_msgs/Imu with angular rates; leave --prior out, or give --prior-file FILE");
  imu.angular_velocity_covariance[0] = 0;
  list.add("/gyro", "sensor_msgs/Imu", kFirst, imu);
  EXPECT_EQ(contents_of(list).motion->name, "/gyro");
}

TEST(StaticTransforms, AreFoundThroughCommonAncestors) {
  StaticTransforms transforms;
  transforms.add({transform_message("/base", "mast", kMount), transform_message("mast", "camera", kMount),
                  transform_message("base", "imu", kMount), transform_message("a", "b", {}),
                  transform_message("b", "a", {})});
  TransformMessage wrong = transform_message("base", "broken", {});
  wrong.transform.orientation.coeffs().setZero();
  transforms.add({wrong});
  const auto found = transforms.find("imu", "/camera");
  ASSERT_TRUE(found);
  const Rigid3 expected = kMount.inverse() * kMount * kMount;
  EXPECT_TRUE(found->translation.isApprox(expected.translation));
  EXPECT_TRUE(found->rotation.isApprox(expected.rotation));
  EXPECT_FALSE(transforms.find("imu", "broken"));
  EXPECT_FALSE(transforms.find("imu", "a")) << "a circle ends";
  EXPECT_FALSE(transforms.find("", ""));
}

}  // namespace
}  // namespace dkb::test
