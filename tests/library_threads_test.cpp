// SPDX-License-Identifier: Apache-2.0
// Starts, stops and readers on other threads, on tiny images: what the sanitizers run.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "library_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

class LibraryThreads : public ::testing::Test {
 protected:
  LibraryThreads() : file(fs::path(::testing::TempDir()) / ("dkb_threads_" + std::to_string(::getpid()) + ".dkb")) {}
  ~LibraryThreads() override { fs::remove(file); }
  // Every stage has a thread.
  Slam make(int number) const {
    Detectors detectors;
    detectors.motion = number % 2 == 0;
    detectors.slow =
        std::make_shared<DepthDetector>(number % 3 == 0 ? DepthDetector::Gives::masks : DepthDetector::Gives::boxes);
    detectors.schedule = {.every = 1 + number % 3, .latency = number % 4};
    Options options;
    options.realtime = number % 5 == 0;
    return Slam(world.camera(), options, detectors, std::make_shared<EveryNth>(2));
  }

  WallWorld world{136, 100};
  std::vector<Frame> frames = world.walk(0, 24, 6);
  fs::path file;
};

// The one that comes while another is at work is refused, whole.
TEST_F(LibraryThreads, TwoThreadsThatFeedHarmNothing) {
  Slam slam = make(1);
  std::atomic<bool> ended = false;
  std::thread other([&] {
    while (!ended) {
      error_of([&] { slam.localize_only(false); });
      error_of([&] { slam.save_map_task(); });
      slam.on_event({});
      std::this_thread::yield();
    }
  });
  for (const Frame& frame : frames) {
    std::string error;
    do {
      error = error_of([&] { slam.process(frame); });
    } while (error.find("it is at work") != std::string::npos);
    EXPECT_EQ(error, "no error");
  }
  ended = true;
  other.join();
  slam.finish();
  Slam alone = make(1);
  run(alone, frames);
  EXPECT_EQ(bytes_of(slam), bytes_of(alone));
}

TEST_F(LibraryThreads, AThousandStartsStopsResetsAndLoads) {
  {
    Slam mapper = make(1);
    run(mapper, {frames.begin(), frames.begin() + 6});
    ASSERT_EQ(mapper.statistics().tracked, 6);
    ASSERT_GT(mapper.map().point_count(), 50U);
    mapper.save_map(file);
  }
  Slam lasting = make(0);
  for (int n = 0; n < 1000; ++n) {
    const auto first = static_cast<size_t>(n % 16);
    switch (n % 4) {
      case 0: {  // a short life, with work outstanding in the end
        Slam slam = make(n / 4);
        for (size_t i = first; i < first + static_cast<size_t>(n / 4 % 4); ++i) slam.process(frames[i]);
        if (n % 3 == 0) slam.finish();
        lasting.reset();
        break;
      }
      case 1:
        lasting.reset();
        break;
      case 2:
        lasting.load_map(file);
        break;
      default:
        lasting.finish();
        lasting.finish();
        lasting.reset();
    }
    lasting.process(frames[first]);
    if (n % 7 == 0) lasting.process(frames[first + 1]);
  }
  lasting.reset();
  Slam fresh = make(0);
  Options patient;
  EXPECT_TRUE(lasting.process(frames[0]).tracked());
  EXPECT_TRUE(fresh.process(frames[0]).tracked());
}

TEST_F(LibraryThreads, AnyThreadReadsWhileOneFeeds) {
  Slam slam = make(2);
  std::atomic<bool> done{false};
  std::atomic<size_t> reads{0}, events{0};
  const auto read = [&] {
    MapSnapshot kept;
    std::vector<PointInfo> of_kept;
    while (!done) {
      const MapSnapshot map = slam.map();
      const auto points = map.points();
      const auto keyframes = map.keyframes();
      EXPECT_EQ(points.size(), map.point_count());
      EXPECT_EQ(static_cast<int>(keyframes.size()), map.keyframe_count());
      for (size_t i = 1; i < points.size(); ++i) ASSERT_LT(points[i - 1].id, points[i].id);
      EXPECT_LE(slam.trajectory().size(), frames.size());
      EXPECT_LE(slam.online_trajectory().size(), frames.size());
      slam.keyframes();
      EXPECT_LE(slam.statistics().tracked, static_cast<int>(frames.size()));
      events += slam.take_events().size();
      // A snapshot stays as it is, however tracking goes on.
      const auto again = kept.points();
      ASSERT_EQ(again.size(), of_kept.size());
      for (size_t i = 0; i < again.size(); ++i) ASSERT_EQ(again[i].position_in_world, of_kept[i].position_in_world);
      if (++reads % 5 == 0) kept = map, of_kept = points;
    }
  };
  std::thread first(read), second(read);
  feed(slam, frames);
  slam.finish();
  slam.save_map(file);
  slam.reset();
  feed(slam, frames);
  slam.load_map(file);
  feed(slam, frames);
  slam.finish();
  while (reads < 20) std::this_thread::yield();
  done = true;
  first.join();
  second.join();
  EXPECT_GT(events + slam.take_events().size(), 6U);
}

TEST_F(LibraryThreads, ReadersDoNotChangeABit) {
  Slam watched = make(2), alone = make(2);
  std::atomic<bool> done{false};
  std::thread reader([&] {
    while (!done) {
      watched.map().points();
      watched.trajectory();
      watched.statistics();
    }
  });
  const std::string seen = feed(watched, frames);
  watched.finish();
  done = true;
  reader.join();
  EXPECT_EQ(seen, feed(alone, frames));
  alone.finish();
  EXPECT_EQ(bytes_of(watched), bytes_of(alone));
}

TEST_F(LibraryThreads, SystemsOnThreadsOfTheirOwnGiveTheSameBytes) {
  Slam alone = make(4);
  const std::string expected = run(alone, frames);
  std::string got[3];
  std::vector<std::thread> threads;
  for (std::string& bytes : got)
    threads.emplace_back([&] {
      Slam slam = make(4);
      bytes = run(slam, frames);
    });
  for (std::thread& t : threads) t.join();
  for (const std::string& bytes : got) EXPECT_EQ(bytes, expected);
}

TEST_F(LibraryThreads, ASystemMayBeMovedAndOutliveNothingOfItsOrigin) {
  Slam first = make(2), expected = make(2);
  feed(first, {frames.begin(), frames.begin() + 10});
  Slam second = std::move(first);
  feed(second, {frames.begin() + 10, frames.end()});
  second.finish();
  run(expected, frames);
  EXPECT_EQ(bytes_of(second), bytes_of(expected));
}

}  // namespace
}  // namespace dkb::test
