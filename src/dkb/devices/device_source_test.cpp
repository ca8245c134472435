// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/device_source.h"

#include <gtest/gtest.h>

#include <deque>
#include <thread>

#include "dkb/dataset/paced_source.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"
#include "dkb_slam/errors.h"

namespace dkb {
namespace {

constexpr int64_t kMs = 1'000'000;

Camera small_camera() {
  Camera camera;
  camera.width = 32, camera.height = 24, camera.cx = 15.5, camera.cy = 11.5, camera.fps = 30;
  return camera;
}

// Gives what it is told to give, an image at a time.
class ScriptedDevice final : public ImageDevice {
 public:
  struct Step {
    DeviceState state = DeviceState::images;
    int64_t stamp_ms = 0;
    bool is_depth = false;
    int width = 32;
  };
  explicit ScriptedDevice(std::deque<Step> steps) : steps_(std::move(steps)) {}
  DeviceState next(int, DeviceImages* images) override {
    if (steps_.empty()) return DeviceState::ended;
    const Step step = steps_.front();
    steps_.pop_front();
    if (step.state != DeviceState::images) return step.state;
    const DeviceImage image{{pixels_, step.width, 24, 0, step.is_depth ? PixelFormat::depth_u16 : PixelFormat::grey8},
                            step.stamp_ms * kMs};
    (step.is_depth ? images->depth : images->colour) = image;
    return step.state;
  }
  bool reopen() override { return ++reopened_ > 1; }
  std::string description() const override { return "scripted"; }

 private:
  std::deque<Step> steps_;
  uint8_t pixels_[32 * 24 * 2] = {};
  int reopened_ = 0;
};

using Steps = std::deque<ScriptedDevice::Step>;

void add_pair(Steps* steps, int64_t ms, int64_t depth_ms) {
  steps->push_back({DeviceState::images, ms, false});
  steps->push_back({DeviceState::images, depth_ms, true});
}

std::vector<int64_t> stamps_of(Source& source) {
  std::vector<int64_t> stamps;
  for (SourceFrame f = source.next(); f.state != SourceState::ended; f = source.next())
    stamps.push_back(f.state == SourceState::frame       ? f.frame.stamp_ns() / kMs
                     : f.state == SourceState::unplugged ? -1
                                                         : -2);
  return stamps;
}

using Stamps = std::vector<int64_t>;

TEST(ImagePairs, EachColourImageTakesTheNearestDepthImageOnce) {
  Steps steps;
  add_pair(&steps, 100, 95);
  add_pair(&steps, 133, 128);
  add_pair(&steps, 166, 161);
  steps.push_back({DeviceState::images, 200, false});  // its depth image is missing
  add_pair(&steps, 233, 228);
  add_pair(&steps, 266, 261);
  add_pair(&steps, 300, 294);
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(source), (Stamps{100, 133, 166, 233, 266, 300}));
  EXPECT_EQ(source.counts().unpaired, 1);
}

TEST(ImagePairs, StampsThatDoNotRiseAreLeftOut) {
  Steps steps;
  add_pair(&steps, 100, 100), add_pair(&steps, 133, 133), add_pair(&steps, 133, 133), add_pair(&steps, 120, 120);
  add_pair(&steps, 166, 166);
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(source), (Stamps{100, 133, 166}));
  EXPECT_EQ(source.counts().late, 4);
}

TEST(ImagePairs, StampsBeyondAllTimesAreLeftOut) {
  ImagePairs pairs;
  const std::vector<uint8_t> pixels(32 * 24 * 2);
  const auto add = [&](int64_t ns, bool is_depth) {
    pairs.add({{pixels.data(), 32, 24, 0, is_depth ? PixelFormat::depth_u16 : PixelFormat::grey8}, ns}, is_depth);
  };
  add(100 * kMs, false);
  for (const int64_t ns : {INT64_MIN, int64_t{-1}, INT64_MAX}) add(ns, false), add(ns, true);
  add(100 * kMs, true);
  EXPECT_TRUE(pairs.take());
  EXPECT_EQ(pairs.late(), 6);
}

TEST(ImagePairs, OneStampFarAheadCostsTenImages) {
  for (const bool both : {false, true}) {
    Steps steps;
    for (int n = 0; n < 40; ++n) {
      const int64_t stamp = 100 + 33 * n, wrong = 3'600'000;
      add_pair(&steps, n == 5 ? wrong : stamp, n == 5 && both ? wrong : stamp);
    }
    DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
    const Stamps stamps = stamps_of(source);
    // The first colour image after them comes before the depth image that would be its partner counts.
    ASSERT_EQ(stamps.size(), both ? 29U : 30U);
    EXPECT_EQ(stamps[4], 100 + 33 * 4);
    EXPECT_EQ(stamps[5], 100 + 33 * (both ? 16 : 15));
    EXPECT_EQ(source.counts().late, both ? 18 : 9);
  }
}

TEST(DeviceSource, GoesOnAfterAClockThatIsSetBack) {
  Steps steps;
  for (int n = 0; n < 20; ++n) add_pair(&steps, 100'000 + 33 * n, 100'000 + 33 * n);
  for (int n = 0; n < 40; ++n) add_pair(&steps, 100 + 33 * n, 100 + 33 * n);
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  const Stamps stamps = stamps_of(source);
  ASSERT_GE(stamps.size(), 48U);
  for (size_t i = 1; i < stamps.size(); ++i) EXPECT_GT(stamps[i], stamps[i - 1]);
  EXPECT_EQ(stamps.back() - stamps[stamps.size() - 2], 33);
}

TEST(ImagePairs, RandomArrivalsGiveRisingPairsWithinTheLimit) {
  Random random(3);
  ImagePairs pairs;
  const std::vector<uint8_t> pixels(32 * 24 * 2);
  int64_t last_colour = -1, last_depth = -1, taken = 0, added = 0;
  for (int i = 0; i < 20'000; ++i) {
    const bool is_depth = random.below(2) == 1;
    const int64_t stamp = (int64_t{i} * 16 + random.below(60)) * kMs;
    pairs.add({{pixels.data(), 32, 24, 0, is_depth ? PixelFormat::depth_u16 : PixelFormat::grey8}, stamp}, is_depth);
    ++added;
    while (const auto pair = pairs.take()) {
      EXPECT_LE(std::abs(pair->colour.stamp_ns - pair->depth.stamp_ns), 20 * kMs);
      EXPECT_GT(pair->colour.stamp_ns, last_colour);
      EXPECT_GT(pair->depth.stamp_ns, last_depth);
      last_colour = pair->colour.stamp_ns, last_depth = pair->depth.stamp_ns;
      ++taken;
    }
  }
  EXPECT_GT(taken, 1000);
  pairs.restart();
  EXPECT_EQ(2 * taken + pairs.unpaired() + pairs.late(), added) << "each image counts once";
}

TEST(DeviceSource, APairIsNotHeldBackWhereNothingLaterCanBeNearer) {
  Steps steps;
  add_pair(&steps, 100, 95);
  add_pair(&steps, 133, 128);
  steps.push_back({DeviceState::waiting});
  // Ends after the last image: only what was handed out before it counts.
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(source), (Stamps{100, 133}));
}

TEST(DeviceSource, TheEndOfTheImagesSettlesTheLastPair) {
  Steps steps;
  add_pair(&steps, 100, 85);  // with no other image known, a nearer one could come
  DeviceSource one(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(one), (Stamps{100}));
  EXPECT_EQ(one.counts().unpaired, 0);
  steps.push_back({DeviceState::images, 150, false});
  DeviceSource other(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(other), (Stamps{100}));
  EXPECT_EQ(other.counts().unpaired, 1);
}

TEST(DeviceSource, UnplugIsToldOnceAndStampsGoOnRisingAfterIt) {
  Steps steps;
  add_pair(&steps, 100, 100), add_pair(&steps, 133, 133);
  steps.push_back({DeviceState::unplugged});
  add_pair(&steps, 10, 10), add_pair(&steps, 43, 43);  // its clock started anew
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  const Stamps stamps = stamps_of(source);
  ASSERT_EQ(stamps.size(), 5u);
  EXPECT_EQ(stamps[2], -1);
  EXPECT_GT(stamps[3], 133 + 900) << "half a second passes between attempts to open it, and the second succeeds";
  EXPECT_EQ(stamps[4] - stamps[3], 33);
}

TEST(DeviceSource, AnImageOfAnotherSizeIsSkipped) {
  Steps steps;
  add_pair(&steps, 100, 100);
  steps.push_back({DeviceState::images, 133, false, 16});
  steps.push_back({DeviceState::images, 133, true});
  add_pair(&steps, 166, 166);
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), {});
  EXPECT_EQ(stamps_of(source), (Stamps{100, -2, 166}));
}

TEST(DeviceSource, OptionsChooseTheFrames) {
  Steps steps;
  for (int i = 0; i < 10; ++i) add_pair(&steps, 100 * i, 100 * i);
  SourceOptions options;
  options.skip_pairs = 2, options.start = 0.1, options.max_frames = 3;
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), options);
  EXPECT_EQ(stamps_of(source), (Stamps{300, 400, 500}));
}

TEST(DeviceSource, TheLastFrameThatIsWantedEndsItWithoutAWaitForAnother) {
  Steps steps;
  for (int i = 0; i < 3; ++i) add_pair(&steps, 100 * i, 100 * i);
  steps.push_back({DeviceState::unplugged});  // nobody gets to hear of it
  SourceOptions options;
  options.max_frames = 3;
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), options);
  EXPECT_EQ(stamps_of(source), (Stamps{0, 100, 200}));
}

TEST(DeviceSource, OptionsAreCheckedAndOnesThatLeaveNothingAreNamed) {
  Steps steps;
  for (int i = 0; i < 3; ++i) add_pair(&steps, 100 * i, 100 * i);
  SourceOptions options;
  options.start = 2, options.end = 1;
  EXPECT_THROW(DeviceSource(std::make_unique<ScriptedDevice>(steps), small_camera(), options), InvalidOption);
  options.end = 5;
  DeviceSource source(std::make_unique<ScriptedDevice>(steps), small_camera(), options);
  EXPECT_NE(test::input_error_of([&] { source.next(); }).find("no pair lies between --start and --end"),
            std::string::npos);
  EXPECT_EQ(source.next().state, SourceState::ended);
}

TEST(DeviceCamera, TheUnitOfDepthIsTheDevicesWhateverTheCameraFileSays) {
  Camera told;
  told.fx = 0, told.depth_factor = 1000;
  SourceOptions file, map;
  file.camera = "fr1";  // 5000 units per metre, as in TUM's folders
  map.fallback_camera.emplace();
  for (const SourceOptions& options : {file, map}) {
    EXPECT_EQ(device_camera("it", told, options).depth_factor, 1000);
    Camera silent = told;
    silent.depth_factor = 0;
    EXPECT_EQ(device_camera("it", silent, options).depth_factor, 5000);
  }
}

TEST(DeviceSource, StopEndsTheWaitForADeviceThatIsGone) {
  Steps steps;
  steps.push_back({DeviceState::unplugged});
  const auto source = PacedSource::of_device(
      std::make_unique<DeviceSource>(std::make_unique<ScriptedDevice>(steps), small_camera(), SourceOptions{}));
  EXPECT_EQ(source->next().state, SourceState::unplugged);
  std::thread stopper([&] { source->stop(); });
  EXPECT_EQ(source->next().state, SourceState::ended);
  stopper.join();
}

}  // namespace
}  // namespace dkb
