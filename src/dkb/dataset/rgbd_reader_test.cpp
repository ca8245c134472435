// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/image_codecs.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_data.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

// Twelve small pairs on disk; pair n has grey 10 n and depth n / 4 + 1 m.
class RgbdReaderTest : public testing::Test {
 protected:
  static constexpr int kPairs = 12;
  RgbdReaderTest() : folder(fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_rgbd_reader")) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    camera.width = 32, camera.height = 24, camera.cx = 16, camera.cy = 12;
    for (int n = 0; n < kPairs; ++n) {
      DatasetPair pair;
      pair.timestamp = n, pair.depth_timestamp = n + 0.01;
      pair.stamp = std::to_string(n) + ".00";
      pair.colour_path = folder / ("c" + std::to_string(n)), pair.depth_path = folder / ("d" + std::to_string(n));
      const auto grey = static_cast<uint8_t>(10 * n);
      write_image_file(pair.colour_path, encode_png(ColourImage(32, 24, Rgb{grey, grey, grey})));
      write_image_file(pair.depth_path, encode_png(Image<uint16_t>(32, 24, static_cast<uint16_t>(5000 + 1250 * n))));
      pairs.push_back(pair);
    }
  }
  ~RgbdReaderTest() override { fs::remove_all(folder); }

  std::string probe_error() const {
    return test::input_error_of([&] { RgbdReader reader(pairs, camera, {}); });
  }
  std::vector<DatasetFrame> read_all(const RgbdReaderOptions& options) const {
    RgbdReader reader(pairs, camera, options);
    std::vector<DatasetFrame> frames;
    while (auto frame = reader.next()) frames.push_back(*frame);
    EXPECT_EQ(reader.times().summaries().at("decoding").count, pairs.size());
    return frames;
  }
  void spoil(const fs::path& path) const { write_image_file(path, read_file(path).substr(0, 60)); }

  const fs::path folder;
  CameraModel camera;
  std::vector<DatasetPair> pairs;
};

TEST_F(RgbdReaderTest, HandsOutEveryPairInOrderWhateverTheThreads) {
  for (const bool threaded : {true, false}) {
    const std::vector<DatasetFrame> frames = read_all({.threaded = threaded});
    ASSERT_EQ(frames.size(), static_cast<size_t>(kPairs));
    for (size_t n = 0; n < frames.size(); ++n) {
      EXPECT_EQ(frames[n].index, n);
      EXPECT_EQ(frames[n].stamp, pairs[n].stamp);
      ASSERT_NE(frames[n].image, nullptr);
      EXPECT_EQ(frames[n].image->timestamp, pairs[n].timestamp);
      EXPECT_EQ(frames[n].image->depth_timestamp, pairs[n].depth_timestamp);
      EXPECT_EQ(frames[n].image->grey, GreyImage(32, 24, static_cast<uint8_t>(10 * n)));
      EXPECT_EQ(frames[n].image->depth(5, 5), 1.0f + 0.25f * static_cast<float>(n));
    }
  }
}

TEST_F(RgbdReaderTest, SingleBadPairsAreSkippedWithAReason) {
  spoil(pairs[2].colour_path);
  write_image_file(pairs[7].depth_path, "");
  fs::remove(pairs[8].colour_path);
  write_image_file(pairs[9].depth_path, encode_png(Image<uint16_t>(16, 24, 5000)));
  write_image_file(pairs[10].depth_path, encode_png(GreyImage(32, 24, 50)));
  for (const bool threaded : {true, false}) {
    const std::vector<DatasetFrame> frames = read_all({.threaded = threaded});
    ASSERT_EQ(frames.size(), static_cast<size_t>(kPairs));
    for (size_t n = 0; n < frames.size(); ++n) {
      const bool bad = n == 2 || (n >= 7 && n <= 10);
      EXPECT_EQ(frames[n].image == nullptr, bad) << n;
      EXPECT_EQ(frames[n].skipped.empty(), !bad) << n;
    }
    EXPECT_EQ(frames[7].skipped, pairs[7].depth_path.string() + ": is empty");
    EXPECT_EQ(frames[9].skipped,
              pairs[9].depth_path.string() + ": is of 16x24 px, of another size than the frames before (32x24)");
    EXPECT_EQ(frames[2].skipped.rfind(pairs[2].colour_path.string(), 0), 0u) << frames[2].skipped;
  }
}

TEST_F(RgbdReaderTest, AFolderOfBrokenImagesIsRefused) {
  for (size_t n = 0; n < 5; ++n) spoil(pairs[n].colour_path);
  EXPECT_EQ(probe_error().rfind("none of the first 5 pairs can be decoded: " + pairs[0].colour_path.string(), 0), 0u)
      << probe_error();
}

TEST_F(RgbdReaderTest, OneSoundPairAmongTheFirstFiveIsEnough) {
  for (const size_t n : {0, 1, 2, 4}) spoil(pairs[n].depth_path);
  EXPECT_EQ(probe_error(), "no error");
}

TEST_F(RgbdReaderTest, AnyOfTheFirstFiveOfAWrongTypeOrSizeIsRefused) {
  write_image_file(pairs[4].depth_path, encode_png(GreyImage(32, 24, 50)));
  EXPECT_EQ(probe_error(),
            pairs[4].depth_path.string() +
                ": is an 8-bit grey PNG; depth must be 16-bit grey PNG, 32-bit float in TIFF or PFM, or uint16 "
                "or float32 in NPY");
  write_image_file(pairs[4].depth_path, encode_png(Image<uint16_t>(16, 12, 5000)));
  EXPECT_NE(probe_error().find("is of 16x12 px, the camera of 32x24"), std::string::npos);
  write_image_file(pairs[4].depth_path, encode_png(Image<uint16_t>(32, 24, 5000)));
  write_image_file(pairs[3].colour_path, encode_png(GreyImage(64, 48)));
  EXPECT_NE(probe_error().find("is of 64x48 px"), std::string::npos);
}

TEST_F(RgbdReaderTest, ABrokenFileOfAnotherSizeIsASkippedFrameNotAWrongDataset) {
  const std::string other = encode_png(Image<uint16_t>(16, 12, 5000));
  write_image_file(pairs[1].depth_path, other.substr(0, other.size() - 20));
  EXPECT_EQ(probe_error(), "no error");
}

TEST_F(RgbdReaderTest, WhatTheProbeDecodesIsNotDecodedAgain) {
  RgbdReader reader(pairs, camera, {.threaded = false});
  fs::remove(pairs[0].colour_path);
  EXPECT_NE(reader.next()->image, nullptr);
}

TEST_F(RgbdReaderTest, GreyCamerasHaveNoColour) {
  write_image_file(pairs[0].colour_path, encode_png(GreyImage(32, 24, 7)));
  RgbdReader reader(pairs, camera, {});
  const auto frame = reader.next();
  EXPECT_TRUE(frame->image->colour.empty());
  EXPECT_EQ(frame->image->grey, GreyImage(32, 24, 7));
}

// Answers pair by pair, then fails.
class Stream {
 public:
  std::optional<StoredPair> operator()() {
    if (given_ == 6) throw InputError("the recording is torn");
    StoredPair pair;
    pair.stamp_ns = given_;
    pair.mismatch = [] { return ""; };
    pair.decode = [this, n = given_++] {
      // The third pair is ready after the fourth alone.
      if (n == 3) std::call_once(begun_, [this] { fourth_.set_value(); });
      if (n == 2 && has_begun_.wait_for(std::chrono::seconds(60)) != std::future_status::ready)
        throw InputError("the fourth pair waits for the third");
      return std::make_shared<RgbdImage>();
    };
    return pair;
  }

 private:
  int given_ = 0;
  std::promise<void> fourth_;
  std::shared_future<void> has_begun_ = fourth_.get_future().share();
  std::once_flag begun_;
};

TEST_F(RgbdReaderTest, TwoPairsAreDecodedAtOnceAndHandedOutInOrderAndAnErrorAfterThem) {
  const auto stream = std::make_shared<Stream>();
  RgbdReader reader([stream] { return (*stream)(); }, {});
  for (int n = 0; n < 6; ++n) {
    const std::optional<DatasetFrame> frame = reader.next();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->stamp_ns, n);
    EXPECT_EQ(frame->skipped, "");
  }
  for (int again = 0; again < 2; ++again)
    EXPECT_EQ(test::input_error_of([&] { reader.next(); }), "the recording is torn");
}

// Four pairs. Who decodes the second one first gets no further until it is let go, as a thread that other programs
// leave no time.
class StarvedStream {
 public:
  std::optional<StoredPair> operator()() {
    if (given_ == 4) return std::nullopt;
    StoredPair pair;
    pair.stamp_ns = given_;
    pair.mismatch = [] { return ""; };
    pair.decode = [this, n = given_++] {
      if (n == 1 && !starved_.exchange(true)) {
        begun.set_value();
        let_go.get_future().wait();
      }
      return std::make_shared<RgbdImage>();
    };
    return pair;
  }
  std::promise<void> begun, let_go;

 private:
  int given_ = 0;
  std::atomic<bool> starved_ = false;
};

TEST_F(RgbdReaderTest, APairWhoseThreadGetsNoTimeIsDecodedForWhoWaitsForIt) {
  const auto stream = std::make_shared<StarvedStream>();
  RgbdReader reader([stream] { return (*stream)(); }, {});
  stream->begun.get_future().wait();
  for (int n = 0; n < 4; ++n) {
    const std::optional<DatasetFrame> frame = reader.next();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->stamp_ns, n);
    EXPECT_NE(frame->image, nullptr);
  }
  EXPECT_FALSE(reader.next().has_value());
  stream->let_go.set_value();
  EXPECT_EQ(reader.times().summaries().at("decoding").count, 4U);
}

TEST_F(RgbdReaderTest, StopsAtAnyTime) {
  { RgbdReader unread(pairs, camera, {}); }  // the thread waits on a full queue
  RgbdReader reader(pairs, camera, {});
  EXPECT_TRUE(reader.next().has_value());
  std::thread stopper([&] { reader.stop(); });
  while (reader.next()) {
  }
  stopper.join();
  EXPECT_FALSE(reader.next().has_value());
}

TEST(RgbdReaderRealData, ReadsARecordedSequence) {
  const fs::path folder = test_data() / "rgbd_dataset_freiburg1_xyz";
  if (!fs::exists(folder)) GTEST_SKIP() << "skipped: no recorded sequence at hand";
  TumDataset dataset = open_tum_dataset(folder);
  EXPECT_EQ(dataset.pairs.size(), 261u);
  select_pairs({.max_frames = 8}, &dataset);
  RgbdReader reader(dataset.pairs, choose_camera("", folder).camera, {});
  size_t frames = 0;
  while (const auto frame = reader.next()) {
    ASSERT_NE(frame->image, nullptr) << frame->skipped;
    size_t with_depth = 0;
    for (size_t i = 0; i < frame->image->depth.size(); ++i) with_depth += frame->image->depth.data()[i] > 0;
    EXPECT_GT(with_depth, frame->image->depth.size() / 2);
    ++frames;
  }
  EXPECT_EQ(frames, 8u);
}

}  // namespace
}  // namespace dkb
