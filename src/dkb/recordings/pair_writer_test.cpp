// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/pair_writer.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>

#include "dkb/dataset/folder_source.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/recorded_camera.h"
#include "dkb/recordings/recorded_source.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// While it lives, no file may grow beyond this: writing fails half-way, as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

constexpr int kWidth = 320, kHeight = 240;

Camera camera() {
  Camera c;
  c.width = kWidth, c.height = kHeight, c.cx = 159.5, c.cy = 119.5, c.depth_factor = 1000;
  return c;
}

void add(PairWriter& writer, int n, int64_t stamp_ns, int64_t depth_stamp_ns) {
  Random random(static_cast<uint64_t>(n));
  Picture picture;
  picture.colour = ColourImage(kWidth, kHeight);
  for (size_t i = 0; i < picture.colour.size(); ++i)
    picture.colour.data()[i] = {static_cast<uint8_t>(random.below(256)), 0, static_cast<uint8_t>(n)};
  const DepthImage depth(kWidth, kHeight, 1.0F + 0.25F * static_cast<float>(n));
  writer.add({stamp_ns, depth_stamp_ns, {}, &picture, &depth});
}
void add(PairWriter& writer, int n) {
  const int64_t stamp = int64_t{1'000'000'000} + n * int64_t{33'000'000};
  add(writer, n, stamp, stamp);
}

int frames_in(Source& source) {
  int frames = 0;
  for (SourceFrame f = source.next(); f.state != SourceState::ended; f = source.next()) {
    EXPECT_EQ(f.state, SourceState::frame) << f.note;
    EXPECT_EQ(f.frame.image()->depth(5, 5), 1.0F + 0.25F * static_cast<float>(frames)) << "in order, none missing";
    ++frames;
  }
  return frames;
}

std::unique_ptr<Source> open_any(const fs::path& path) {
  if (path.has_extension()) return std::make_unique<RecordedSource>(path, SourceOptions{});
  return std::make_unique<FolderSource>(path, SourceOptions{});
}

size_t entries_of(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(PairWriter, CameraInfoTellsRationalDistortion) {
  const TempFolder scratch;
  Camera written = camera();
  written.set_distortion("rational_polynomial", {0.5, -2.6, 0.0007, -0.0002, 1.5, 0.38, -2.45, 1.43});
  const auto writer = write_pairs(scratch / "a.bag", written, written.to_yaml());
  add(*writer, 0);
  writer->close();
  const auto stream = open_messages(scratch / "a.bag");
  stream->select({"/camera/rgb/camera_info"});
  const auto message = stream->next();
  ASSERT_TRUE(message);
  const Camera read = camera_of(decode_camera_info(message->bytes, MessageEncoding::ros1), false, "info");
  EXPECT_EQ(read.p2, -0.0002);
  EXPECT_EQ(read.k6, 1.43);
  EXPECT_EQ(RecordedSource(scratch / "a.bag", {}).camera().k5, -2.45);
}

TEST(PairWriter, OfARecordingNoPairIsLostWhoseStampsDoNotTellIt) {
  struct Case {
    const char* name;
    std::vector<std::pair<int, int>> stamps;  // [ms] colour, depth
    std::vector<int> depth_read;              // [ms]
  };
  for (const Case& c : {Case{"repeated", {{0, 1}, {33, 1}, {66, 67}}, {1, 33, 67}},
                        Case{"going back", {{0, 2}, {10, 1}, {33, 34}}, {2, 10, 34}},
                        Case{"far apart", {{0, 25}, {33, 58}, {66, 41}}, {0, 33, 66}},
                        Case{"nearer to the next colour image", {{0, 18}, {33, 51}, {66, 84}}, {18, 33, 84}},
                        Case{"after the next colour image", {{0, 15}, {10, 25}, {20, 35}}, {0, 10, 35}},
                        // The nearest pair goes first, and leaves the first two to each other.
                        Case{"told by the next pair", {{0, 18}, {33, 34}, {66, 67}}, {18, 34, 67}}}) {
    SCOPED_TRACE(c.name);
    const TempFolder temp;
    std::vector<std::string> warnings;
    PairWriterOptions options;
    options.warn = [&](const std::string& line) { warnings.push_back(line); };
    const auto writer = write_pairs(temp / "a.mcap", camera(), camera().to_yaml(), options);
    const auto ns = [](int ms) { return int64_t{1'305'031'102'000'000'000} + ms * int64_t{1'000'000}; };
    bool kept = true;
    for (size_t n = 0; n < c.stamps.size(); ++n) {
      add(*writer, static_cast<int>(n), ns(c.stamps[n].first), ns(c.stamps[n].second));
      kept = kept && c.stamps[n].second == c.depth_read[n];
    }
    writer->close();
    EXPECT_EQ(warnings.size(), kept ? 0u : 1u);
    RecordedSource source(temp / "a.mcap", SourceOptions{});
    for (size_t n = 0; n < c.stamps.size(); ++n) {
      const SourceFrame f = source.next();
      ASSERT_EQ(f.state, SourceState::frame) << n << " " << f.note;
      EXPECT_EQ(f.frame.stamp_ns(), ns(c.stamps[n].first));
      EXPECT_EQ(f.frame.depth_stamp_ns(), ns(c.depth_read[n]));
      EXPECT_EQ(f.frame.image()->depth(5, 5), 1.0F + 0.25F * static_cast<float>(n));
    }
    EXPECT_EQ(source.next().state, SourceState::ended);
  }
}

TEST(PairWriter, OfARecordingThatFillsTheDiskTheWholeChunksAreKept) {
  for (const char* name : {"a.bag", "a.mcap"}) {
    SCOPED_TRACE(name);
    const TempFolder temp;
    {
      const auto writer = write_pairs(temp / name, camera(), camera().to_yaml());
      int n = 0;
      // Some 384 kB a pair. The chunk at the limit cannot be finished.
      const FileSizeLimit limit(2'000'000);
      EXPECT_THROW(for (; n < 100; ++n) add(*writer, n), OutputError);
      EXPECT_LT(n, 10);
      writer->salvage();
    }
    RecordedSource source(temp / name, SourceOptions{});
    const int frames = frames_in(source);
    EXPECT_GE(frames, 3);
    EXPECT_LE(frames, 5);
    EXPECT_EQ(entries_of(temp.path()), 1u) << "no temporary file";
  }
}

TEST(PairWriter, TheLastChunkGivesItsRoomToTheIndex) {
  for (const char* name : {"a.bag", "a.mcap"}) {
    SCOPED_TRACE(name);
    const TempFolder temp;
    const auto write = [&](const char* file, std::optional<rlim_t> limit) {
      const auto writer = write_pairs(temp / file, camera(), camera().to_yaml());
      for (int n = 0; n < 6; ++n) add(*writer, n);
      if (!limit) return writer->close();
      const FileSizeLimit full(*limit);
      EXPECT_THROW(writer->close(), OutputError);
      writer->salvage();
    };
    const std::string whole = std::string("whole-") + name;
    write(whole.c_str(), {});
    write(name, fs::file_size(temp / whole) - 10);  // the index lacks ten bytes
    RecordedSource source(temp / name, SourceOptions{});
    const int frames = frames_in(source);
    EXPECT_GE(frames, 3);
    EXPECT_LT(frames, 6);
  }
}

TEST(PairWriter, ARecordingIsNotShortenedWhereOnlyItsNameCannotBeTaken) {
  for (const char* name : {"a.bag", "a.mcap"}) {
    SCOPED_TRACE(name);
    const TempFolder temp;
    {
      const auto writer = write_pairs(temp / name, camera(), camera().to_yaml());
      for (int n = 0; n < 6; ++n) add(*writer, n);
      fs::create_directory(temp / name);  // somebody takes the name meanwhile
      EXPECT_THROW(writer->close(), OutputError);
      EXPECT_THROW(writer->salvage(), OutputError);
      fs::remove(temp / name);
      writer->salvage();
    }
    RecordedSource source(temp / name, SourceOptions{});
    EXPECT_EQ(frames_in(source), 6);
  }
}

TEST(PairWriter, AFolderInThePlaceOfARecordingIsFoundOutAtOnce) {
  const TempFolder temp;
  for (const char* name : {"a.bag", "a.mcap"}) {
    fs::create_directory(temp / name);
    EXPECT_NE(input_error_of([&] { write_pairs(temp / name, camera(), camera().to_yaml()); }).find("is a folder"),
              std::string::npos);
  }
}

TEST(PairWriter, LinksStayAndWhatTheyLeadToIsWritten) {
  for (const char* name : {"a.bag", "a.mcap", "folder"}) {
    SCOPED_TRACE(name);
    const TempFolder temp;
    const fs::path target = temp / "disk" / name, link = temp / name;
    fs::create_directory(temp / "disk");
    fs::create_symlink(fs::path("disk") / name, link);  // to nothing yet
    for (int round = 0; round < 2; ++round) {
      {
        const auto writer = write_pairs(link, camera(), camera().to_yaml());
        for (int n = 0; n < 3; ++n) add(*writer, n);
        writer->close();
      }
      EXPECT_TRUE(fs::is_symlink(link));
      EXPECT_FALSE(fs::is_symlink(target));
      EXPECT_EQ(frames_in(*open_any(target)), 3);
      EXPECT_EQ(entries_of(temp / "disk"), 1U) << "nothing else is left there";
      if (target.has_extension()) continue;
      fs::remove_all(target);
      fs::create_directory(target);  // an empty folder is filled
    }
  }
}

TEST(PairWriter, NoRecordingTakesThePlaceOfAPipe) {
  const TempFolder temp;
  ASSERT_EQ(::mkfifo((temp / "pipe").c_str(), 0600), 0);
  for (const char* name : {"a.bag", "a.mcap"}) {
    fs::create_symlink("pipe", temp / name);
    EXPECT_EQ(input_error_of([&] { write_pairs(temp / name, camera(), camera().to_yaml()); }),
              (temp / name).string() + ": is a device or a pipe; a recording needs the name of a file");
  }
  EXPECT_TRUE(fs::is_fifo(temp / "pipe"));
}

TEST(PairWriter, OfAFolderThatFillsTheDiskTheWholePairsAreKept) {
  const TempFolder temp;
  {
    const auto writer = write_pairs(temp / "out", camera(), camera().to_yaml());
    for (int n = 0; n < 5; ++n) add(*writer, n);
    const FileSizeLimit limit(300);  // images do not fit, nor do lists of more than two or three pairs
    EXPECT_THROW(add(*writer, 5), OutputError);
    writer->salvage();
  }
  FolderSource source(temp / "out", SourceOptions{});
  const int frames = frames_in(source);
  EXPECT_GE(frames, 1);
  EXPECT_LT(frames, 5);
  EXPECT_EQ(entries_of(temp / "out/rgb"), static_cast<size_t>(frames));
  EXPECT_EQ(entries_of(temp / "out/depth"), static_cast<size_t>(frames));
  EXPECT_EQ(entries_of(temp.path()), 1u) << "no temporary folder";
}

TEST(PairWriter, NothingIsLeftBehindWhereNothingFits) {
  const TempFolder temp;
  {
    const FileSizeLimit limit(10);
    EXPECT_THROW(write_pairs(temp / "out", camera(), camera().to_yaml()), OutputError) << "the camera file";
    EXPECT_THROW(write_pairs(temp / "out.bag", camera(), camera().to_yaml()), OutputError);
  }
  EXPECT_EQ(entries_of(temp.path()), 0u);
}

}  // namespace
}  // namespace dkb::test
