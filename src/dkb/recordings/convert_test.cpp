// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/convert.h"

#include <gtest/gtest.h>

#include <limits>

#include "dkb/dataset/folder_source.h"
#include "dkb/recordings/message_list_test_tools.h"
#include "dkb/recordings/recorded_source.h"
#include "dkb/recordings/recording_test_tools.h"
#include "dkb/util/stamps.h"
#include "dkb/util/test_errors.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// Six pairs: PNG, JPEG and grey pictures; 16-bit depth, and one image of floats.
class ConvertTest : public testing::Test {
 protected:
  ConvertTest() {
    options.warn = [this](const std::string& line) { warnings.push_back(line); };
  }

  void write_folder(double depth_factor, int64_t depth_delay_ns = 4'000'001) {
    Camera camera = small_camera();
    camera.depth_factor = depth_factor, camera.readout = 0.01, camera.k3 = 0.1;
    fs::create_directories(scratch / "in");
    camera_text = "# measured on a Monday\n" + camera.to_yaml();
    write_bytes(scratch / "in/camera.yaml", camera_text);
    std::string list;
    for (int n = 0; n < 6; ++n) {
      const std::string colour = "c" + std::to_string(n), depth = "d" + std::to_string(n);
      const ColourImage picture = noise_picture(static_cast<uint64_t>(n));
      write_bytes(scratch / "in" / colour, n == 1   ? encode_jpeg(picture)
                                           : n == 2 ? encode_png(grey_from_colour(picture))
                                                    : encode_png(picture));
      if (n == 3) {
        Image<float> metres(32, 24, 1.23456789F);
        metres(0, 0) = 1e9F, metres(1, 0) = std::numeric_limits<float>::quiet_NaN(), metres(2, 0) = 20;
        write_bytes(scratch / "in" / depth, encode_tiff(metres));
      } else {
        write_bytes(scratch / "in" / depth, encode_png(noise_depth(static_cast<uint64_t>(n))));
      }
      const int64_t stamp = kFirst + n * kInterval;
      list += stamp_text(stamp) + " " + colour + " " + stamp_text(stamp + depth_delay_ns) + " " + depth + "\n";
    }
    write_bytes(scratch / "in/associations.txt", list);
  }

  std::vector<SourceFrame> frames(const std::string& name) const {
    std::unique_ptr<Source> source;
    if (fs::is_directory(scratch / name))
      source = std::make_unique<FolderSource>(scratch / name, SourceOptions{});
    else
      source = std::make_unique<RecordedSource>(scratch / name, SourceOptions{});
    std::vector<SourceFrame> all;
    for (SourceFrame next = source->next(); next.state != SourceState::ended; next = source->next())
      all.push_back(std::move(next));
    return all;
  }

  void expect_same(const std::string& name) const {
    SCOPED_TRACE(name);
    const std::vector<SourceFrame> a = frames("in"), b = frames(name);
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(b[i].state, SourceState::frame) << b[i].note;
      EXPECT_EQ(a[i].stamp, b[i].stamp);
      EXPECT_EQ(a[i].frame.depth_stamp_ns(), b[i].frame.depth_stamp_ns());
      EXPECT_EQ(a[i].frame.image()->grey, b[i].frame.image()->grey);
      EXPECT_EQ(a[i].frame.image()->colour, b[i].frame.image()->colour);
      EXPECT_EQ(a[i].frame.image()->depth, b[i].frame.image()->depth);
    }
  }

  void convert_and_compare(const std::string& in, const std::string& out) {
    convert(scratch / in, scratch / out, options);
    expect_same(out);
  }

  TempFolder scratch;
  ConvertOptions options;
  std::vector<std::string> warnings;
  std::string camera_text;
};

TEST_F(ConvertTest, TheSameFramesAreReadWhateverTheyAreConvertedTo) {
  for (const double factor : {1000.0, 5000.0, 1234.5}) {
    SCOPED_TRACE(factor);
    write_folder(factor);
    convert_and_compare("in", "a.bag");
    convert_and_compare("in", "a.mcap");
    convert_and_compare("in", "out");
    convert_and_compare("a.bag", "b.mcap");
    convert_and_compare("b.mcap", "b.bag");
    convert_and_compare("b.bag", "back");
    EXPECT_EQ(read_file(scratch / "back/camera.yaml"), camera_text);
    EXPECT_EQ(read_file(scratch / "back" / ("rgb/" + stamp_text(kFirst + kInterval) + ".jpg")),
              read_file(scratch / "in/c1"));
    EXPECT_TRUE(fs::exists(scratch / "back" / ("depth/" + stamp_text(kFirst + 4'000'001) + ".png")));
    for (const char* name : {"out", "back"}) fs::remove_all(scratch / name);
  }
  EXPECT_TRUE(warnings.empty()) << warnings[0];
}

TEST_F(ConvertTest, ColourMayGoAsPixels) {
  write_folder(5000);
  options.raw = true;
  convert(scratch / "in", scratch / "raw.mcap", options);
  const auto stream = open_messages(scratch / "raw.mcap");
  for (const RecordedTopic& topic : stream->topics()) EXPECT_NE(topic.type, "sensor_msgs/CompressedImage");
  EXPECT_EQ(stream->metadata().at("dkb_slam_camera"), camera_text);
  while (const auto message = stream->next()) {
    if (stream->topics()[message->topic].name == "/dkb_slam/camera") {
      EXPECT_EQ(decode_string(message->bytes, MessageEncoding::ros1), camera_text);
    }
  }
}

TEST_F(ConvertTest, PairsThatStampsDoNotTellGetOneStamp) {
  write_folder(5000, 30'000'000);  // farther apart than readers look
  convert(scratch / "in", scratch / "a.bag", options);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("depth images get the stamps of their colour images"), std::string::npos);
  const std::vector<SourceFrame> read = frames("a.bag");
  ASSERT_EQ(read.size(), 6U);
  EXPECT_EQ(read[2].frame.depth_stamp_ns(), read[2].frame.stamp_ns());
}

TEST_F(ConvertTest, PairsThatCannotBeReadAreLeftOutAndTold) {
  write_folder(5000);
  write_bytes(scratch / "in/d4", "broken");
  EXPECT_EQ(convert(scratch / "in", scratch / "a.bag", options).count, 5U);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("d4: is not an image"), std::string::npos) << warnings[0];
}

TEST_F(ConvertTest, NothingIsLeftBehindWhenItFails) {
  write_folder(5000);
  write_bytes(scratch / "a.bag", "kept");
  for (int n = 0; n < 6; ++n) write_bytes(scratch / ("in/d" + std::to_string(n)), "broken");
  EXPECT_THROW(convert(scratch / "in", scratch / "a.bag", options), InputError);
  EXPECT_THROW(convert(scratch / "in", scratch / "new", options), InputError);
  EXPECT_EQ(read_file(scratch / "a.bag"), "kept");
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch / "."), {}), 2);  // in and a.bag
  EXPECT_NE(input_error_of([&] { convert(scratch / "in", scratch / "in", options); }).find("not empty"),
            std::string::npos);
  EXPECT_NE(input_error_of([&] { convert(scratch / "none", scratch / "x.bag", options); }).find("no such file"),
            std::string::npos);
}

TEST_F(ConvertTest, AKindThatIsNotWrittenIsRefused) {
  write_folder(5000);
  for (const char* name : {"out.db3", "out.oni"}) {
    EXPECT_NE(input_error_of([&] { convert(scratch / "in", scratch / name, options); }).find("FILE.mcap or FILE.bag"),
              std::string::npos);
    EXPECT_FALSE(fs::exists(scratch / name));
  }
}

// Frames of the layouts' own cameras, of 640 x 480 px.
TEST_F(ConvertTest, FoldersOfOtherLayoutsGiveTheSameFrames) {
  const auto write_pair = [&](const std::string& colour, const std::string& depth, int n) {
    ColourImage picture(640, 480, {static_cast<uint8_t>(50 * n), 100, 200});
    Image<uint16_t> units(640, 480, static_cast<uint16_t>(1000 + n));
    units(1, 1) = 65535, units(2, 2) = 0;
    write_bytes(scratch / "in" / colour, encode_png(picture));
    write_bytes(scratch / "in" / depth, encode_png(units));
  };
  for (const std::string layout : {"ICL-NUIM", "7-Scenes", "ScanNet"}) {
    SCOPED_TRACE(layout);
    for (const char* name : {"in", "out"}) fs::remove_all(scratch / name);
    for (const char* name : {"rgb", "depth", "color", "intrinsic"}) fs::create_directories(scratch / "in" / name);
    std::string list;
    for (int n = 0; n < 3; ++n) {
      const std::string number = std::to_string(n);
      if (layout == "ICL-NUIM") {
        write_pair("rgb/" + number + ".png", "depth/" + number + ".png", n);
        list += number + " depth/" + number + ".png " + number + " rgb/" + number + ".png\n";
      } else if (layout == "7-Scenes") {
        write_pair("frame-00000" + number + ".color.png", "frame-00000" + number + ".depth.png", n);
      } else {
        write_bytes(scratch / "in/color" / (number + ".jpg"), encode_jpeg(noise_picture(3, 64, 48)));
        write_bytes(scratch / "in/depth" / (number + ".png"), encode_png(noise_depth(4)));
      }
    }
    if (layout == "ICL-NUIM") write_bytes(scratch / "in/associations.txt", list);
    if (layout == "ScanNet")
      write_bytes(scratch / "in/intrinsic/intrinsic_color.txt", "60 0 31 0\n0 60 23 0\n0 0 1 0\n0 0 0 1\n");
    for (const char* out : {"a.mcap", "a.bag", "out"}) {
      convert_and_compare("in", out);
      EXPECT_EQ(frames(out)[1].frame.stamp_ns(), 33'333'000);
    }
  }
  EXPECT_TRUE(warnings.empty()) << warnings[0];
}

TEST_F(ConvertTest, RecordingsOfOtherKindsAreRefusedWithARemedy) {
  write_bytes(scratch / "a.oni", "NI10");
  const std::string oni = (scratch / "a.oni").string(), out = (scratch / "b.bag").string();
  EXPECT_EQ(input_error_of([&] { convert(oni, out, options); }),
            oni + ": is a recording of OpenNI, not of ROS messages; `dkb-slam record " + oni + " --out " + out +
                "` converts it");
}

TEST_F(ConvertTest, DepthOfACameraOfItsOwnIsRegisteredWithoutLimits) {
  const auto writer = write_recording(scratch / "a.bag");
  const auto write = [&](const std::string& topic, const std::string& type, const std::string& bytes) {
    writer->write(writer->add_topic(topic, type), kFirst, bytes);
  };
  const std::string metres = metres_of(Image<uint16_t>(32, 24, 50'000), 2000);  // beyond the 10 m of the camera
  const CameraInfoMessage info = info_message(small_camera(), "colour");
  write(
      "/tf_static", "tf2_msgs/TFMessage",
      encode(TransformsMessage{transform_message("colour", "depth", {Eigen::Quaterniond::Identity(), {0.01, 0, 0}})}));
  write("/rgb/camera_info", "sensor_msgs/CameraInfo", encode(info));
  write("/depth/camera_info", "sensor_msgs/CameraInfo", encode(info_message(small_camera(), "depth")));
  write("/rgb/image", "sensor_msgs/Image",
        encode(image_message(kFirst, "rgb8", 32, 24, bytes_of(noise_picture(1)), "colour")));
  write("/depth/image", "sensor_msgs/Image", encode(image_message(kFirst, "32FC1", 32, 24, metres, "depth")));
  writer->close();
  EXPECT_EQ(convert(scratch / "a.bag", scratch / "out", options).count, 1U);
  Camera camera = choose_camera("", scratch / "out").camera;
  EXPECT_EQ(camera.depth_max, small_camera().depth_max);
  const fs::path depth = fs::directory_iterator(scratch / "out/depth")->path();
  EXPECT_NEAR(read_depth(depth, without_limits(camera))(16, 12), 25, 1e-3);
}

TEST_F(ConvertTest, ImagesOfAnotherSizeThanTheirCameraAreLeftOutAndTold) {
  const auto writer = write_recording(scratch / "a.bag");
  const auto write = [&](const std::string& topic, const std::string& type, int64_t stamp, const std::string& bytes) {
    writer->write(writer->add_topic(topic, type), stamp, bytes);
  };
  write(
      "/tf_static", "tf2_msgs/TFMessage", kFirst,
      encode(TransformsMessage{transform_message("colour", "depth", {Eigen::Quaterniond::Identity(), {0.01, 0, 0}})}));
  const CameraInfoMessage info = info_message(small_camera(), "colour");
  write("/rgb/camera_info", "sensor_msgs/CameraInfo", kFirst, encode(info));
  write("/depth/camera_info", "sensor_msgs/CameraInfo", kFirst, encode(info_message(small_camera(), "depth")));
  // The second pair's depth and the third's colour are larger than their CameraInfo says.
  for (int n = 0; n < 3; ++n) {
    const int64_t stamp = kFirst + n * kInterval;
    const int colour_scale = n == 2 ? 2 : 1, depth_scale = n == 1 ? 10 : 1;
    const std::string colour = bytes_of(noise_picture(1, 32 * colour_scale, 24 * colour_scale));
    const std::string depth = metres_of(Image<uint16_t>(32 * depth_scale, 24 * depth_scale, 10'000));
    write("/rgb/image", "sensor_msgs/Image", stamp,
          encode(image_message(stamp, "rgb8", 32 * colour_scale, 24 * colour_scale, colour, "colour")));
    write("/depth/image", "sensor_msgs/Image", stamp,
          encode(image_message(stamp, "32FC1", 32 * depth_scale, 24 * depth_scale, depth, "depth")));
  }
  writer->close();
  EXPECT_EQ(convert(scratch / "a.bag", scratch / "out", options).count, 1U);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_NE(warnings[0].find("/depth/image"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find("is of 320x240 px, the camera of 32x24"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[1].find("/rgb/image"), std::string::npos) << warnings[1];
  EXPECT_NE(warnings[1].find("is of 64x48 px, the camera of 32x24"), std::string::npos) << warnings[1];
}

TEST_F(ConvertTest, MessagesLargerThanTheirImagesAreLeftOutAndTold) {
  const auto writer = write_recording(scratch / "a.bag");
  const size_t info = writer->add_topic("/rgb/camera_info", "sensor_msgs/CameraInfo");
  const size_t rgb = writer->add_topic("/rgb/image", "sensor_msgs/Image");
  const size_t depth = writer->add_topic("/depth/image", "sensor_msgs/Image");
  writer->write(info, kFirst, encode(info_message(small_camera())));
  const std::string colours = bytes_of(noise_picture(1)), metres = metres_of(noise_depth(1));
  for (int n = 0; n < 2; ++n) {
    const int64_t stamp = kFirst + n * kInterval;
    const std::string more(n == 0 ? 0 : 2 << 20, '\0');
    writer->write(rgb, stamp, encode(image_message(stamp, "rgb8", 32, 24, colours)) + more);
    writer->write(depth, stamp, encode(image_message(stamp, "32FC1", 32, 24, metres)));
  }
  writer->close();
  EXPECT_EQ(convert(scratch / "a.bag", scratch / "out", options).count, 1U);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(warnings[0],
            (scratch / "a.bag").string() +
                ": /rgb/image: a message of 2 MiB is too large for an image of 32x24 px; such are left out");
  EXPECT_EQ(warnings[1], "2 images that are broken or have no partner of their time are left out");
}

TEST_F(ConvertTest, MotionGoesAlongFromRecordingToRecording) {
  const auto writer = write_recording(scratch / "a.bag");
  ImuMessage imu;
  imu.header.stamp_ns = kFirst, imu.angular_velocity = {1, 2, 3};
  writer->write(writer->add_topic("/imu", "sensor_msgs/Imu"), kFirst, encode(imu));
  writer->close();
  EXPECT_EQ(convert(scratch / "a.bag", scratch / "b.mcap", options).count, 1U);
  const auto stream = open_messages(scratch / "b.mcap");
  const auto message = stream->next();
  ASSERT_TRUE(message);
  EXPECT_EQ(decode_imu(message->bytes, MessageEncoding::ros1).angular_velocity, imu.angular_velocity);
}

}  // namespace
}  // namespace dkb::test
