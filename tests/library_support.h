// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/slam.h"

namespace dkb::test {

// A wall of random blocks 2 m before a camera that moves along it, and, where asked for, somebody: a card at 1 m with a
// picture of its own. Images are exact to the pixel: the camera moves by whole pixels of the wall.
class WallWorld {
 public:
  struct Look {
    int shift = 0;         // [px of the wall] the camera's place
    int card = -1000;      // [px] left edge of the card in the image; out of sight unless told
    bool dark = false;     // no picture and no depth
    bool blank = false;    // no picture
    bool flat = false;     // no depth
    uint64_t picture = 1;  // on the wall: another number is another place
  };

  // `period`: the wall's picture repeats itself after so many pixels; 0 = never.
  explicit WallWorld(int width, int height, int period = 0);

  static constexpr double kWall = 2, kCard = 1;  // [m]
  const Camera& camera() const { return camera_; }
  // Frame `index`, at 30 Hz.
  Frame frame(int index, const Look& look) const;
  // The same with a depth image of another time, as a recording may hold it.
  Frame frame(int index, const Look& look, int64_t depth_stamp_ns) const;
  // The truth, from the camera of shift 0.
  double camera_x(int shift) const { return shift * kWall / camera_.fx; }
  // Frames `from` ... `to` - 1: the camera moves by one pixel a frame, and somebody walks through from frame `enters`
  // on.
  std::vector<Frame> walk(int from, int to, int enters = 1000000) const;
  Box card_at(int x) const;

 private:
  Camera camera_;
  int period_;
};

// Everything that a system says of its world, to the last bit.
std::string bytes_of(const Slam& slam);
// Everything that a frame's result says but for its durations, likewise.
std::string bytes_of(const FrameResult& result);

// Feeds the frames; what the results say.
std::string feed(Slam& slam, const std::vector<Frame>& frames);
// The same, finished, with all that is left in the end.
std::string run(Slam& slam, const std::vector<Frame>& frames);

// The events but for keyframes, as "0:new_map 6:lost ".
std::string told(const std::vector<Event>& events);

// Map points on the card.
int leaked_points(const Slam& slam);

// A detector as a user writes it: whoever is nearer than the wall. Stateless, but for what it counts.
class DepthDetector final : public Detector {
 public:
  enum class Gives { boxes, masks, both };
  explicit DepthDetector(Gives gives) : gives_(gives) {}
  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "depth"; }
  void reset() override { ++resets; }

  std::vector<int64_t> seen;  // stamps of the images it was shown; the library's thread's until finish()
  int resets = 0;

 private:
  Gives gives_;
};

// Does what it is told.
class FunctionDetector final : public Detector {
 public:
  explicit FunctionDetector(std::function<Detections(const DetectorInput&)> detect) : detect_(std::move(detect)) {}
  Detections detect(const DetectorInput& image) override { return detect_(image); }
  std::string kind() const override { return "function"; }
  void reset() override {
    if (on_reset) on_reset();
  }
  std::function<void()> on_reset;

 private:
  std::function<Detections(const DetectorInput&)> detect_;
};

// A keyframe every so many frames.
class EveryNth final : public KeyframePolicy {
 public:
  explicit EveryNth(int frames) : frames_(frames) {}
  KeyframeAnswer decide(const KeyframeQuery& query) override {
    if (throws) throws();
    return {query.frames_since_keyframe >= frames_, std::to_string(query.frames_since_keyframe) + " frames"};
  }
  void reset() override { ++resets; }
  std::function<void()> throws;
  int resets = 0;

 private:
  int frames_;
};

// The message of the InputError that `work` throws; "no error" when it throws none. Anything else fails the test.
std::string error_of(const std::function<void()>& work);

// A world to feed to the library, and a folder that goes when the test ends.
class Library : public ::testing::Test {
 protected:
  Library()
      : folder(std::filesystem::path(::testing::TempDir()) /
               ("dkb_library_" + std::to_string(::getpid()) +
                ::testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
  }
  ~Library() override { std::filesystem::remove_all(folder); }
  Slam slam_with(std::shared_ptr<KeyframePolicy> policy = nullptr, const Options& options = Options()) const {
    return Slam(world.camera(), options, Detectors::none(), std::move(policy));
  }

  WallWorld world{320, 240};
  std::filesystem::path folder;
};

}  // namespace dkb::test
