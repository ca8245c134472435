// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/paced_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <future>

namespace dkb {
namespace {

// Gives what it was given; frames of which each says that the camera went one metre since the one before.
class ScriptedSource final : public Source {
 public:
  ScriptedSource() { camera_.width = 32, camera_.height = 24, camera_.cx = 15.5, camera_.cy = 11.5; }
  void add_frame(int64_t stamp_ns) {
    const std::vector<uint8_t> grey(32 * 24);
    const std::vector<float> depth(32 * 24);
    FrameInput input;
    input.stamp_ns = stamp_ns;
    input.colour = {grey.data(), 32, 24, 0, PixelFormat::grey8};
    input.depth = {depth.data(), 32, 24, 0, PixelFormat::depth_f32};
    input.prior.emplace();
    input.prior->previous_from_current.translation.x() = 1;
    SourceFrame next;
    next.state = SourceState::frame;
    next.frame = Frame(camera_, input);
    frames_.push_back(std::move(next));
  }
  void add_skipped() {
    SourceFrame next;
    next.state = SourceState::skipped;
    frames_.push_back(std::move(next));
  }
  const Camera& camera() const override { return camera_; }
  SourceFrame next() override {
    if (frames_.empty()) {
      if (!ended_) all_given.set_value();
      ended_ = true;
      return {};
    }
    SourceFrame next = std::move(frames_.front());
    frames_.pop_front();
    if (!gives_.empty()) {
      gives_.front().set_value();
      gives_.pop_front();
    }
    return next;
  }
  std::string description() const override { return "scripted"; }
  std::promise<void> all_given;
  // Ready when so many frames more have been taken.
  std::future<void> taken(size_t count) {
    while (gives_.size() < count) gives_.emplace_back();
    return gives_[count - 1].get_future();
  }

 private:
  Camera camera_;
  std::deque<SourceFrame> frames_;
  std::deque<std::promise<void>> gives_;
  bool ended_ = false;
};

double metres(const SourceFrame& frame) {
  return frame.frame.prior() ? frame.frame.prior()->previous_from_current.translation.x() : -1;
}

TEST(PacedSource, WhatIsDroppedLeavesItsMotionToTheNextFrameAlsoPastOneThatCannotBeRead) {
  auto scripted = std::make_unique<ScriptedSource>();
  std::future<void> all_given = scripted->all_given.get_future();
  for (int i = 0; i < 30; ++i) scripted->add_frame(i + 1);
  scripted->add_skipped();
  for (int i = 31; i < 60; ++i) scripted->add_frame(i + 1);
  const auto source = PacedSource::of_device(std::move(scripted));
  all_given.wait();  // nobody has taken one: the newest 30 wait
  EXPECT_EQ(source->next().state, SourceState::skipped);
  EXPECT_EQ(metres(source->next()), 31) << "30 that were dropped, and its own";
  EXPECT_EQ(metres(source->next()), 1);
  EXPECT_EQ(source->counts().dropped, 30);
}

TEST(PacedSource, HandsNothingOverWhileItsClockIsHeld) {
  ScriptedSource scripted;
  for (const int64_t ms : {0, 20, 40}) scripted.add_frame(1 + ms * 1'000'000);
  PacedSource source(scripted);
  EXPECT_EQ(source.next().state, SourceState::frame);
  source.hold(true);
  auto rest = std::async(std::launch::async, [&] {
    int frames = 0;
    while (source.next().state == SourceState::frame) ++frames;
    return frames;
  });
  EXPECT_EQ(rest.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  source.hold(false);
  EXPECT_EQ(rest.get(), 2);
}

TEST(PacedSource, WhatComesLateLeavesItsMotionToTheNextFrame) {
  auto scripted = std::make_unique<ScriptedSource>();
  for (const int64_t stamp : {10, 20, 15, 20, 30, 40}) scripted->add_frame(stamp);
  const auto source = PacedSource::of_device(std::move(scripted));
  std::vector<double> motions;
  for (SourceFrame next = source->next(); next.state == SourceState::frame; next = source->next())
    motions.push_back(metres(next));
  EXPECT_EQ(motions, (std::vector<double>{1, 1, 3, 1}));
  EXPECT_EQ(source->counts().late, 2);
}

TEST(PacedSource, TakesTheNextFrameWhenTheConsumerIsDoneWithThisOneOrWorksForLonger) {
  using std::chrono::milliseconds;
  ScriptedSource scripted;
  for (int i = 0; i < 4; ++i) scripted.add_frame(i * 500'000'000LL);
  const std::future<void> third = scripted.taken(3), fourth = scripted.taken(4);
  PacedSource source(scripted);
  source.next();
  source.next();
  EXPECT_EQ(third.wait_for(milliseconds(50)), std::future_status::timeout) << "the consumer works at the second";
  source.next();
  EXPECT_EQ(third.wait_for(milliseconds(0)), std::future_status::ready);
  EXPECT_EQ(fourth.wait_for(milliseconds(50)), std::future_status::timeout);
  EXPECT_EQ(fourth.wait_for(milliseconds(5000)), std::future_status::ready)
      << "after a frame's time it is taken anyway";
}

TEST(PacedSource, AClockThatJumpsKeepsNobodyWaiting) {
  ScriptedSource scripted;
  constexpr int64_t kYears = 1'700'000'000'000'000'000;
  for (const int64_t stamp : {int64_t{0}, int64_t{33'000'000}, kYears, kYears + 33'000'000}) scripted.add_frame(stamp);
  const auto start = std::chrono::steady_clock::now();
  PacedSource source(scripted);
  int frames = 0;
  while (source.next().state == SourceState::frame) ++frames;
  EXPECT_EQ(frames, 4);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

}  // namespace
}  // namespace dkb
