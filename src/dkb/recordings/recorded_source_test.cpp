// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_source.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/image/image.h"
#include "dkb/recordings/message_list_test_tools.h"
#include "dkb/recordings/recording_test_tools.h"
#include "dkb/util/stamps.h"
#include "dkb/util/test_errors.h"

#if DKB_HAS_SQLITE3
#include <sqlite3.h>
#endif

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

std::vector<SourceFrame> frames_of(Source& source) {
  std::vector<SourceFrame> frames;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next())
    frames.push_back(std::move(next));
  return frames;
}

void expect_same(const std::vector<SourceFrame>& a, const std::vector<SourceFrame>& b, const std::string& what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].state, SourceState::frame) << what << i << a[i].note;
    ASSERT_EQ(b[i].state, SourceState::frame) << what << i << b[i].note;
    EXPECT_EQ(a[i].index, b[i].index) << what;
    EXPECT_EQ(a[i].stamp, b[i].stamp) << what;
    EXPECT_EQ(a[i].frame.stamp_ns(), b[i].frame.stamp_ns()) << what;
    EXPECT_EQ(a[i].frame.depth_stamp_ns(), b[i].frame.depth_stamp_ns()) << what;
    const RgbdImage &x = *a[i].frame.image(), &y = *b[i].frame.image();
    EXPECT_EQ(x.timestamp, y.timestamp) << what;
    EXPECT_EQ(x.depth_timestamp, y.depth_timestamp) << what;
    EXPECT_EQ(x.grey, y.grey) << what << i;
    EXPECT_EQ(x.colour, y.colour) << what << i;
    EXPECT_EQ(x.depth, y.depth) << what << i;
  }
}

// The camera of the tests by name, so that no CameraInfo is needed.
class RecordedSourceTest : public testing::Test {
 protected:
  RecordedSourceTest() {
    write_bytes(scratch / "camera.yaml", small_camera().to_yaml());
    options.camera = scratch / "camera.yaml";
  }
  std::unique_ptr<RecordedSource> open(const MessageList& list) const {
    return std::make_unique<RecordedSource>(std::make_unique<MessageList>(list), "r.bag", options);
  }
  std::string refused(const MessageList& list) const {
    return input_error_of([&] { open(list); });
  }

  TempFolder scratch;
  SourceOptions options;
};

// Twelve pairs as a folder, some images without partners among them.
class SameFramesTest : public RecordedSourceTest {
 protected:
  SameFramesTest() {
    folder = scratch / "folder";
    fs::create_directory(folder);
    fs::copy_file(scratch / "camera.yaml", folder / "camera.yaml");
    std::string rgb, depth;
    Random random(3);
    for (int n = 0; n < 12; ++n) {
      const ColourImage picture = noise_picture(static_cast<uint64_t>(n));
      const Image<uint16_t> units = noise_depth(static_cast<uint64_t>(100 + n));
      const int64_t stamp = kFirst + n * kInterval, depth_stamp = stamp + random.below(15'000) * 1000;
      if (n != 5) {
        write_bytes(folder / ("c" + std::to_string(n) + ".png"), encode_png(picture));
        rgb += stamp_text(stamp) + " c" + std::to_string(n) + ".png\n";
        messages.push_back({stamp, "/rgb/image", encode(image_message(stamp, "rgb8", 32, 24, bytes_of(picture)))});
        cdr.push_back(cdr_image(stamp, "rgb8", 32 * 3, bytes_of(picture)));
      }
      if (n != 8) {
        write_bytes(folder / ("d" + std::to_string(n) + ".png"), encode_png(units));
        depth += stamp_text(depth_stamp) + " d" + std::to_string(n) + ".png\n";
        const std::string data = metres_of(units);
        messages.push_back({depth_stamp, "/depth/image", encode(image_message(depth_stamp, "32FC1", 32, 24, data))});
        cdr.push_back(cdr_image(depth_stamp, "32FC1", 32 * 4, data));
      }
    }
    write_bytes(folder / "rgb.txt", rgb);
    write_bytes(folder / "depth.txt", depth);
    FolderSource source(folder, {});
    expected = frames_of(source);
    expected_fps = source.camera().fps;
  }

  // sensor_msgs/msg/Image without a frame, of 32 x 24 px, as ROS 2 lays it out.
  static std::string cdr_image(int64_t stamp, const std::string& encoding, uint32_t step, const std::string& data) {
    std::string out;
    const auto number = [&](auto value) {
      out.append((sizeof value - out.size() % sizeof value) % sizeof value, '\0');
      out.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    const auto text = [&](const std::string& value) {
      number(static_cast<uint32_t>(value.size() + 1));
      out += value + '\0';
    };
    number(static_cast<int32_t>(stamp / kNsPerSecond)), number(static_cast<uint32_t>(stamp % kNsPerSecond));
    text("");
    number(uint32_t{24}), number(uint32_t{32});
    text(encoding);
    out += '\0';
    number(step);
    number(static_cast<uint32_t>(data.size()));
    return std::string("\0\1\0\0", 4) + out + data;
  }

  void expect_expected(const fs::path& path) const {
    RecordedSource source(path, options);
    expect_same(frames_of(source), expected, path.filename().string());
    EXPECT_EQ(source.camera().fps, expected_fps);
    EXPECT_EQ(source.counts().unpaired, 2) << path;
    EXPECT_TRUE(source.take_warnings().empty()) << path;
  }

  struct Message {
    int64_t stamp = 0;
    std::string topic, bytes;
  };
  fs::path folder;
  std::vector<Message> messages;
  std::vector<std::string> cdr;
  std::vector<SourceFrame> expected;
  double expected_fps = 0;
};

TEST_F(SameFramesTest, OfBagsAndMcapFilesAreTheFolders) {
  ASSERT_EQ(expected.size(), 10u);
  for (const auto& [name, compression] :
       {std::pair("none.bag", Compression::none), std::pair("bz2.bag", Compression::bz2),
        std::pair("lz4.bag", Compression::lz4), std::pair("none.mcap", Compression::none),
        std::pair("lz4.mcap", Compression::lz4), std::pair("zstd.mcap", Compression::zstd)}) {
    const auto writer = write_recording(scratch / name, compression);
    const size_t rgb = writer->add_topic("/rgb/image", "sensor_msgs/Image"),
                 depth = writer->add_topic("/depth/image", "sensor_msgs/Image");
    for (const Message& m : messages) writer->write(m.topic == "/rgb/image" ? rgb : depth, m.stamp, m.bytes);
    writer->close();
    expect_expected(scratch / name);
    RecordedSource source(scratch / name, options);
    EXPECT_EQ(source.size(), 11u) << "at most as many as the rarer images";
  }
}

#if DKB_HAS_SQLITE3
TEST_F(SameFramesTest, OfDatabasesAreTheFolders) {
  fs::create_directory(scratch / "bag");
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((scratch / "bag/bag_0.db3").c_str(), &database), SQLITE_OK);
  std::string sql =
      "BEGIN;"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "INSERT INTO topics VALUES(1, '/rgb/image', 'sensor_msgs/msg/Image', 'cdr', '');"
      "INSERT INTO topics VALUES(2, '/depth/image', 'sensor_msgs/msg/Image', 'cdr', '');";
  for (size_t i = 0; i < messages.size(); ++i) {
    std::string hex;
    for (const char c : cdr[i])
      for (const int nibble : {c >> 4 & 15, c & 15}) hex += "0123456789ABCDEF"[nibble];
    sql += "INSERT INTO messages VALUES(" + std::to_string(i) + "," +
           (messages[i].topic == "/rgb/image" ? "1," : "2,") + std::to_string(messages[i].stamp) + ",X'" + hex + "');";
  }
  sql += "COMMIT;";
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
  expect_expected(scratch / "bag/bag_0.db3");
  write_bytes(scratch / "bag/metadata.yaml",
              "rosbag2_bagfile_information:\n  relative_file_paths:\n    - bag_0.db3\n  compression_mode: \"\"\n");
  expect_expected(scratch / "bag");
}
#endif

TEST_F(SameFramesTest, SelectionsAreTheFolders) {
  MessageList list;
  for (const Message& m : messages) list.add_bytes(m.topic, "sensor_msgs/Image", m.stamp, m.bytes);
  for (const auto& [skip, start, end, most] :
       {std::tuple(3, 0.0, 1e9, 100), std::tuple(0, 0.1, 0.3, 100), std::tuple(2, 0.033333, 0.2, 3),
        std::tuple(0, 0.0, 0.066666, 100), std::tuple(9, 0.0, 1e9, 1), std::tuple(10, 0.0, 1e9, 1),
        std::tuple(0, 5.0, 6.0, 1)}) {
    SourceOptions chosen;
    chosen.skip_pairs = skip, chosen.start = start, chosen.end = end, chosen.max_frames = most;
    std::vector<SourceFrame> from_folder;
    const std::string error = input_error_of([&] {
      FolderSource source(folder, chosen);
      from_folder = frames_of(source);
    });
    chosen.camera = options.camera;
    options = chosen;
    std::string same_error = refused(list);
    if (error != "no error") {
      EXPECT_EQ(same_error.substr(same_error.find(": ")), error.substr(error.find(": ")));
      continue;
    }
    ASSERT_EQ(same_error, "no error");
    expect_same(frames_of(*open(list)), from_folder, std::to_string(skip) + " " + std::to_string(start));
  }
}

TEST_F(RecordedSourceTest, OneThreadAndTwoGiveTheSameFrames) {
  MessageList list;
  add_pairs(list, 0, 30);
  const auto threaded = frames_of(*open(list));
  options.threaded = false;
  expect_same(frames_of(*open(list)), threaded, "");
  EXPECT_EQ(threaded.size(), 30u);
}

TEST_F(RecordedSourceTest, TopicsThatAppearLateAreFound) {
  for (const bool indexed : {true, false}) {
    MessageList list(indexed);
    for (int n = 0; n < 50; ++n) add_colour(list, n);
    add_pairs(list, 50, 10);
    const auto source = open(list);
    EXPECT_EQ(frames_of(*source).size(), 10u) << indexed;
    EXPECT_EQ(source->counts().unpaired, 50) << indexed;
  }
}

TEST_F(RecordedSourceTest, StampsThatDoNotRiseAreCountedAndToldOnce) {
  MessageList list;
  add_pairs(list, 0, 6);
  add_colour(list, 3), add_colour(list, 5), add_depth(list, 2);
  add_pairs(list, 6, 2);
  const auto source = open(list);
  EXPECT_EQ(frames_of(*source).size(), 8u);
  EXPECT_EQ(source->counts().late, 3);
  const std::vector<std::string> warnings = source->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0],
            "r.bag: /rgb/image: the stamp 1305031102.099999 is not after the one before it; such images are left out");
}

TEST_F(RecordedSourceTest, WithoutStampsTheTimeOfRecordingStandsIn) {
  MessageList list;
  const std::string picture = bytes_of(noise_picture(1)), depth = metres_of(noise_depth(1));
  for (int n = 0; n < 4; ++n) {
    list.add("/rgb/image", "sensor_msgs/Image", kFirst + n * kInterval, image_message(0, "rgb8", 32, 24, picture));
    list.add("/depth/image", "sensor_msgs/Image", kFirst + n * kInterval + 5, image_message(0, "32FC1", 32, 24, depth));
  }
  const auto source = open(list);
  const auto frames = frames_of(*source);
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[1].frame.stamp_ns(), kFirst + kInterval);
  EXPECT_EQ(source->take_warnings(),
            std::vector<std::string>{"r.bag: its images carry no stamps; the time of their recording stands in"});
}

TEST_F(RecordedSourceTest, StampsMayBeginAtZero) {
  for (const bool indexed : {true, false}) {
    MessageList list(indexed);
    for (int64_t n = 0; n < 4; ++n) {
      const int64_t stamp = n * kInterval, recorded = stamp + 1;
      list.add("/rgb/image", "sensor_msgs/Image", recorded,
               image_message(stamp, "rgb8", 32, 24, bytes_of(noise_picture(1))));
      list.add("/depth/image", "sensor_msgs/Image", recorded,
               image_message(stamp, "32FC1", 32, 24, metres_of(noise_depth(1))));
    }
    const auto source = open(list);
    const auto frames = frames_of(*source);
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_EQ(frames[0].frame.stamp_ns(), 0);
    EXPECT_EQ(frames[1].frame.stamp_ns(), kInterval);
    EXPECT_TRUE(source->take_warnings().empty());
  }
}

TEST_F(RecordedSourceTest, BrokenImagesAreSkippedFrames) {
  MessageList list;
  add_pairs(list, 0, 8);
  std::string& bytes = list.messages()[6].bytes;  // colour of pair 3
  bytes.resize(bytes.size() / 2);
  list.messages()[9].bytes.resize(5);  // depth of pair 4: not even a stamp
  const auto source = open(list);
  const auto frames = frames_of(*source);
  ASSERT_EQ(frames.size(), 7u);
  EXPECT_EQ(frames[3].state, SourceState::skipped);
  EXPECT_NE(frames[3].note.find("/rgb/image: a message is broken"), std::string::npos) << frames[3].note;
  EXPECT_EQ(frames[4].frame.stamp_ns(), kFirst + 5 * kInterval);
  EXPECT_EQ(source->counts().unpaired, 2);
  EXPECT_EQ(source->take_warnings().size(), 1u);
}

TEST_F(RecordedSourceTest, MessagesLargerThanTheirImagesAreLeftOut) {
  MessageList list;
  add_pairs(list, 0, 4);
  list.messages()[4].bytes.append(2 << 20, '\0');  // colour of pair 2
  const auto source = open(list);
  EXPECT_EQ(frames_of(*source).size(), 3u);
  EXPECT_EQ(source->counts().unpaired, 2);
  EXPECT_EQ(
      source->take_warnings(),
      std::vector<std::string>{"r.bag: /rgb/image: a message of 2 MiB is too large for an image of 32x24 px; such "
                               "are left out"});
}

TEST_F(RecordedSourceTest, ARecordingOfBrokenImagesIsRefused) {
  MessageList list;
  add_pairs(list, 0, 8);
  for (size_t i = 2; i < list.messages().size(); i += 2) list.messages()[i].bytes.pop_back();
  list.messages()[0].bytes.pop_back();
  EXPECT_NE(refused(list).find("r.bag: has no colour images"), std::string::npos) << refused(list);
  EXPECT_NE(refused(list).find("/rgb/image: a message is broken"), std::string::npos) << refused(list);
}

TEST_F(RecordedSourceTest, ClocksThatHaveNothingInCommonAreTold) {
  MessageList list;
  const std::string picture = bytes_of(noise_picture(1)), depth = metres_of(noise_depth(1));
  for (int64_t n = 1; n < 4; ++n) {
    list.add("/rgb/image", "sensor_msgs/Image", n, image_message(kFirst + n * kInterval, "rgb8", 32, 24, picture));
    list.add("/depth/image", "sensor_msgs/Image", n, image_message(n * kInterval, "32FC1", 32, 24, depth));
  }
  EXPECT_EQ(refused(list),
            "r.bag: no colour image of /rgb/image has a depth image of /depth/image within 20 ms; both must be of one "
            "clock");
}

TEST_F(RecordedSourceTest, ImagesOfAnotherSizeThanTheCameraAreRefused) {
  MessageList list;
  const std::string picture = bytes_of(noise_picture(1, 16, 12)), depth = metres_of(noise_depth(1, 16, 12));
  list.add("/rgb/image", "sensor_msgs/Image", 1, image_message(kFirst, "rgb8", 16, 12, picture));
  list.add("/depth/image", "sensor_msgs/Image", 1, image_message(kFirst, "32FC1", 16, 12, depth));
  EXPECT_EQ(refused(list),
            "/rgb/image at 1305031102.000000: is of 16x12 px, the camera of 32x24; give the camera of this dataset, "
            "and depth registered to colour");
}

TEST_F(RecordedSourceTest, StopsAtAnyTime) {
  MessageList list;
  add_pairs(list, 0, 100);
  const auto source = open(list);
  EXPECT_EQ(source->next().state, SourceState::frame);
  source->stop();
  EXPECT_EQ(source->next().state, SourceState::ended);
}

TEST_F(RecordedSourceTest, SurvivesMutatedMessages) {
  MessageList list;
  for (int n = 0; n < 3; ++n) {
    add_pairs(list, n, 1, "camera");
    list.add("/rgb/camera_info", "sensor_msgs/CameraInfo", kFirst, info_message(small_camera(), "camera"));
    list.add("/depth/camera_info", "sensor_msgs/CameraInfo", kFirst, info_message(small_camera(), "camera"));
    OdometryMessage odometry;
    odometry.header = {kFirst + n * kInterval, "odom", 0}, odometry.child_frame_id = "base";
    list.add("/odom", "nav_msgs/Odometry", kFirst, odometry);
    list.add("/tf_static", "tf2_msgs/TFMessage", kFirst,
             TransformsMessage{transform_message("base", "camera", {}), transform_message("camera", "imu", {})});
  }
  list.add_bytes("/dkb_slam/camera", "std_msgs/String", kFirst, encode_string(small_camera().to_yaml()));
  Random random(7);
  options.threaded = false;
  for (int round = 0; round < 3000; ++round) {
    options.camera = round % 2 == 0 ? (scratch / "camera.yaml").string() : "";
    MessageList damaged = list;
    for (uint32_t n = 1 + random.below(4); n > 0; --n) {
      MessageList::Message& m = damaged.messages()[random.below(static_cast<uint32_t>(list.messages().size()))];
      m.bytes = mutated(m.bytes, random);
    }
    input_error_of([&] { frames_of(*open(damaged)); });
  }
}

TEST_F(RecordedSourceTest, OneStampFarAheadCostsTenFrames) {
  MessageList list;
  add_pairs(list, 0, 15), add_colour(list, 100'000), add_pairs(list, 15, 40);
  const auto source = open(list);
  EXPECT_EQ(frames_of(*source).size(), 46U);
  EXPECT_EQ(source->counts().late, 9);
}

TEST_F(RecordedSourceTest, AClockThatIsSetBackIsToldAtTheEnd) {
  MessageList list;
  add_pairs(list, 1000, 20), add_pairs(list, 0, 30);
  const auto source = open(list);
  EXPECT_EQ(frames_of(*source).size(), 20U);
  EXPECT_EQ(source->counts().late, 60);
  const std::vector<std::string> warnings = source->take_warnings();
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(
      warnings[1],
      "r.bag: the clock of its images was set back: the last 60 of them have stamps before those of pairs that were "
      "used, and are left out; split the recording there to use them");
}

// A robot on a circle: 0.5 m/s and 0.4 rad/s about its z axis.
Rigid3 on_the_circle(double t) {
  const double angle = 0.4 * t, radius = 0.5 / 0.4;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
          {radius * std::sin(angle), radius * (1 - std::cos(angle)), 0}};
}

// The odometry of each interval is recorded 50 ms after the images that end it.
TEST(RecordedMotion, ComesWithTheFramesOfARecording) {
  // Looks along the robot's x axis, 0.3 m in front of its middle.
  const Rigid3 mount{Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {0.3, 0, 0.2}};
  const auto ns = [](double t) { return kFirst + static_cast<int64_t>(t * 1e9); };
  MessageList list;
  list.add("/tf_static", "tf2_msgs/TFMessage", 0, TransformsMessage{transform_message("base", "camera", mount)});
  list.add("/rgb/camera_info", "sensor_msgs/CameraInfo", 0, info_message(small_camera(), "camera"));
  int count = 0;
  const auto add_odometry = [&](double recorded) {
    const Rigid3 pose = on_the_circle(0.01 * count);
    OdometryMessage message;
    message.header = {ns(0.01 * count++), "odom", 0}, message.child_frame_id = "base";
    message.pose = {pose.translation, pose.rotation};
    list.add("/odom", "nav_msgs/Odometry", ns(recorded), message);
  };
  for (int n = 0; n < 20; ++n) {
    const double t = 1e-9 * static_cast<double>(n * kInterval);
    while (0.01 * count + 0.05 < t) add_odometry(t);
    add_pairs(list, n, 1, "camera");
  }
  while (count < 80) add_odometry(1);
  size_t pictures = 0;
  for (MessageList::Message& m : list.messages())
    if (list.topics()[m.topic].name == "/rgb/image" && ++pictures == 8) m.bytes.resize(500);
  RecordedSource source(std::make_unique<MessageList>(list), "r.bag", {});
  double before = -1;
  int frames = 0;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next()) {
    if (next.state == SourceState::skipped) continue;
    const double now = 1e-9 * static_cast<double>(next.frame.stamp_ns() - kFirst);
    ASSERT_EQ(next.frame.prior().has_value(), before >= 0) << now;
    if (before >= 0) {
      const Rigid3 truth = (on_the_circle(before) * mount).inverse() * (on_the_circle(now) * mount);
      const Rigid3& told = next.frame.prior()->previous_from_current;
      EXPECT_LT((told.translation - truth.translation).norm(), 1e-4);
      EXPECT_LT(told.rotation.angularDistance(truth.rotation), 1e-4);
    }
    before = now;
    ++frames;
  }
  EXPECT_EQ(frames, 19) << "the motion through the one that is broken is part of the next one's";
}

}  // namespace
}  // namespace dkb::test
