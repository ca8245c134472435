// SPDX-License-Identifier: Apache-2.0
// `dkb-slam run` on recordings of ROS messages.
#include <gtest/gtest.h>

#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/image_codecs.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 20;

// The first frames of the sequence, with its camera where `with_camera`, each depth image so many times, and a message
// of odometry on each of these topics.
void write_recording_of(const fs::path& path, bool with_camera, Compression compression = Compression::none,
                        int times = 1, const std::vector<std::string>& odometries = {}) {
  const auto writer = write_recording(path, compression);
  const size_t camera = writer->add_topic("/dkb_slam/camera", "std_msgs/String", true);
  const size_t rgb = writer->add_topic("/camera/rgb/image_color", "sensor_msgs/Image"),
               depth = writer->add_topic("/camera/depth/image", "sensor_msgs/Image");
  SourceOptions options;
  options.max_frames = kFrames;
  FolderSource source(sequence(), options);
  bool first = true;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next()) {
    const auto write = [&](size_t topic, int64_t stamp, const std::string& encoding, const ImageView& view) {
      ImageMessage message;
      message.header.stamp_ns = stamp;
      message.width = static_cast<uint32_t>(view.width), message.height = static_cast<uint32_t>(view.height);
      message.encoding = encoding, message.step = static_cast<uint32_t>(view.row_bytes());
      message.data = {static_cast<const char*>(view.data), view.row_bytes() * static_cast<size_t>(view.height)};
      writer->write(topic, stamp, encode(message));
    };
    const int64_t stamp = next.frame.stamp_ns();
    if (first && with_camera) writer->write(camera, stamp, encode_string(read_text(sequence() / "camera.yaml")));
    if (first)
      for (const std::string& topic : odometries) {
        OdometryMessage odometry;
        odometry.header = {stamp, "odom", 0}, odometry.child_frame_id = "base";
        writer->write(writer->add_topic(topic, "nav_msgs/Odometry"), stamp, encode(odometry));
      }
    first = false;
    write(rgb, stamp, "rgb8", next.frame.colour());
    for (int i = 0; i < times; ++i) write(depth, next.frame.depth_stamp_ns(), "32FC1", next.frame.depth());
  }
  writer->close();
}

TEST(RecordingRun, ARecordingGivesTheFoldersBytes) {
  const TempFolder temp;
  const SlamRun folder(sequence(), temp / "folder", {"--max-frames", std::to_string(kFrames), "--detector", "motion"});
  ASSERT_EQ(folder.finished.exit_code, 0) << folder.finished.err;
  for (const auto& [name, compression] :
       {std::pair("a.bag", Compression::none), std::pair("b.mcap", Compression::none)}) {
    write_recording_of(temp / name, true, compression);
    const SlamRun run(temp / name, temp / (std::string(name) + "-out"), {"--detector", "motion"});
    ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
    EXPECT_EQ(run.finished.err, "");
    for (const char* result : {"trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.dkb"})
      EXPECT_EQ(read_text(run.out / result), read_text(folder.out / result)) << name << " " << result;
    EXPECT_EQ(run.stats.at("frames"), kFrames);
    EXPECT_EQ(run.stats.at("stages").at("decoding").at("count"), kFrames);
  }
}

TEST(RecordingRun, IsUsedUpToWhereItWasCutOff) {
  const TempFolder temp;
  write_recording_of(temp / "a.bag", true);
  fs::resize_file(temp / "a.bag", fs::file_size(temp / "a.bag") / 2);
  const SlamRun run(temp / "a.bag", temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.finished.error_lines(), 1u) << run.finished.err;
  EXPECT_NE(run.finished.err.find("a.bag"), std::string::npos) << run.finished.err;
  EXPECT_GE(run.stats.at("frames"), kFrames / 2 - 2);
  EXPECT_LE(run.stats.at("frames"), kFrames / 2);
}

TEST(RecordingRun, WithoutACameraTheMapsIsTaken) {
  const TempFolder temp;
  const SlamRun first(sequence(), temp / "first", {"--max-frames", std::to_string(kFrames)});
  ASSERT_EQ(first.finished.exit_code, 0) << first.finished.err;
  write_recording_of(temp / "a.bag", false);
  const SlamRun alone(temp / "a.bag", temp / "alone");
  EXPECT_EQ(alone.finished.exit_code, 2);
  EXPECT_EQ(alone.finished.err,
            "error: " + (temp / "a.bag").string() +
                ": the camera is not known: no CameraInfo belongs to /camera/rgb/image_color; give --camera FILE, or "
                "fr1, fr2, fr3, bonn\n");
  const SlamRun in_map(temp / "a.bag", temp / "in_map", {"--localize", "--load-map", (first.out / "map.dkb").string()});
  EXPECT_EQ(in_map.finished.exit_code, 0) << in_map.finished.err;
}

TEST(RecordingRun, BoxesMasksAndTheUnitOfTimesNeedNoListOfStamps) {
  const TempFolder temp;
  write_recording_of(temp / "a.bag", true);
  const std::string stamp = rows_of(sequence() / "rgb.txt").front()[0];
  fs::create_directory(temp / "masks");
  write_image_file(temp / "masks" / (stamp + ".png"), encode_png(GreyImage(640, 480, 255)));
  write_text(temp / "boxes.txt", stamp + " person 10 10 50 50\n");
  const SlamRun run(temp / "a.bag", temp / "out",
                    {"--detector", "file", "--boxes", temp / "boxes.txt", "--masks", temp / "masks", "--cv-orb"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("detector").at("kind"), "file+masks");
  EXPECT_LT(run.stats.at("tracked"), kFrames) << "nothing is seen of the first frame";
  EXPECT_TRUE(fs::exists(run.out / "cv_orb.json"));
}

TEST(ConvertCommand, ImagesThatCannotBeUsedAreToldOnceAndCounted) {
  const TempFolder temp;
  write_recording_of(temp / "a.bag", true, Compression::none, 2);
  const Finished run = run_program({"convert", (temp / "a.bag").string(), "--out", (temp / "out").string()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.err.find("warning: " + (temp / "a.bag").string() + ": /camera/depth/image: the stamp "), 0U) << run.err;
  EXPECT_NE(run.err.find(" is not after the one before it; such images are left out\nwarning: " +
                         std::to_string(kFrames) + " images whose stamps do not rise are left out\n"),
            std::string::npos)
      << run.err;
  EXPECT_EQ(run.error_lines(), 2U) << run.err;
}

TEST(ConvertCommand, MotionThatNobodyWritesIsNotAskedFor) {
  const TempFolder temp;
  write_recording_of(temp / "one.bag", true, Compression::none, 1, {"/odom"});
  write_recording_of(temp / "two.bag", true, Compression::none, 1, {"/odom", "/wheels"});
  for (const char* bag : {"one.bag", "two.bag"})
    for (const char* command : {"convert", "record"}) {
      const std::string out = (temp / (std::string(bag) + command)).string();
      const Finished run = run_program({command, (temp / bag).string(), "--out", out});
      EXPECT_EQ(run.exit_code, 0) << run.err;
      EXPECT_EQ(run.err, "") << command << " " << bag;
    }
}

TEST(RecordingRun, PlayedAsACameraItsLostImagesAreToldOnce) {
  const TempFolder temp;
  write_recording_of(temp / "a.bag", true, Compression::none, 2);
  const Finished run =
      run_program({"live", (temp / "a.bag").string(), "--detector", "none", "--out", (temp / "out").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find(" late or repeated"), std::string::npos) << run.out;
  EXPECT_EQ(run.out.find(" without a partner of their time"), std::string::npos) << run.out;
}

TEST(RecordCommand, OnATerminalWarningsBeginALineOfTheirOwn) {
  const TempFolder temp;
  copy_sequence(temp / "in", kSequenceFrames, true);
  write_text(temp / "in" / rows_of(temp / "in/rgb.txt").at(34).at(1), "broken");  // frames are counted at the 30th
  const std::string shown = told_to_a_terminal("@ record " + (temp / "in").string() + " --out " +
                                               (temp / "out.bag").string() + " >" + (temp / "said").string());
  EXPECT_NE(shown.find("30 frames\r\nwarning: "), std::string::npos) << shown;
  EXPECT_EQ(shown.find("\n\r\n"), std::string::npos) << "no empty line: " << shown;
}

TEST(RecordingRun, OptionsThatFitNothingAreRefused) {
  const TempFolder temp;
  write_recording_of(temp / "a.bag", true);
  const SlamRun topic(temp / "a.bag", temp / "out", {"--depth-topic", "/no"});
  EXPECT_EQ(topic.finished.exit_code, 2);
  EXPECT_EQ(topic.finished.err,
            "error: --depth-topic /no: " + (temp / "a.bag").string() +
                " has no depth images there; it has images on /camera/rgb/image_color (rgb8), /camera/depth/image "
                "(32FC1)\n");
  const SlamRun prior(temp / "a.bag", temp / "out", {"--prior", "odm"});
  EXPECT_EQ(prior.finished.exit_code, 2);
  EXPECT_EQ(prior.finished.err,
            "error: --prior: there is no \"odm\" (did you mean \"odom\"?); none, odom, imu, auto\n");
}

}  // namespace
}  // namespace dkb::test
