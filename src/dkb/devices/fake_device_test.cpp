// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/fake_device.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/timing.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

constexpr int kFrames = 60;  // at 30 Hz

class FakeDevice : public testing::Test {
 protected:
  FakeDevice() : folder(fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_fake")) {
    fs::create_directories(folder);
    write_image_file(folder / "c.png", encode_png(GreyImage(16, 16, 90)));
    write_image_file(folder / "d.png", encode_png(Image<uint16_t>(16, 16, 5000)));
    std::string list;
    for (int i = 0; i < kFrames; ++i) {
      const std::string stamp = std::to_string(1000 + i / 30.0);
      list += stamp + " c.png " + stamp + " d.png\n";
    }
    write_file_atomically(folder / "associations.txt", list);
    write_file_atomically(folder / "camera.yaml",
                          "fx: 20\nfy: 20\ncx: 7.5\ncy: 7.5\nwidth: 16\nheight: 16\ndepth_factor: 5000\n");
  }
  ~FakeDevice() override { fs::remove_all(folder); }

  struct Seen {
    std::vector<size_t> frames;  // by index in the folder
    int unplugged = 0;
    SourceCounts counts;
    double seconds = 0;
  };
  // All frames, which must have rising stamps.
  Seen play(const std::string& parameters) const {
    const auto source = open_fake_device("fake:" + folder.string() + "?" + parameters, {});
    Seen seen;
    int64_t last = -1;
    const Stopwatch watch;
    for (SourceFrame f = source->next(); f.state != SourceState::ended; f = source->next()) {
      if (f.state == SourceState::unplugged) ++seen.unplugged;
      if (f.state != SourceState::frame) continue;
      EXPECT_GT(f.frame.stamp_ns(), last);
      last = f.frame.stamp_ns();
      seen.frames.push_back(f.index);
    }
    seen.seconds = watch.ms() / 1000;
    seen.counts = source->counts();
    return seen;
  }
  const fs::path folder;
};

TEST_F(FakeDevice, PlaysAtThePaceOfTheStamps) {
  const Seen seen = play("speed=10");
  EXPECT_EQ(seen.frames.size(), static_cast<size_t>(kFrames));
  EXPECT_GE(seen.seconds, 59 / 30.0 / 10 - 0.01);
  EXPECT_EQ(seen.counts.late, 0);
}

TEST_F(FakeDevice, WarnsAsItsFolderDoes) {
  write_file_atomically(folder / "associations.txt", "1000.5 c.png 1000.5 d.png\n1005.5 c.png 1005.5 d.png\n");
  const std::vector<std::string> warnings =
      open_fake_device("fake:" + folder.string() + "?speed=1000", {})->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("are 5 s apart in the median"), std::string::npos) << warnings[0];
}

TEST_F(FakeDevice, DroppedFramesNeverCome) {
  const Seen seen = play("drop=0.3&speed=20&seed=7");
  EXPECT_LT(seen.frames.size(), 55u);
  EXPECT_GT(seen.frames.size(), 30u);
  EXPECT_EQ(seen.counts.late, 0);
  EXPECT_EQ(play("drop=0.3&speed=20&seed=7").frames, seen.frames) << "the same seed, the same faults";
  EXPECT_NE(play("drop=0.3&speed=20&seed=8").frames, seen.frames);
}

TEST_F(FakeDevice, DoubledSwappedAndLateFramesAreLeftOutAndCounted) {
  for (const std::string fault : {"double", "swap", "late"}) {
    const Seen seen = play(fault + "=0.2&speed=20");
    EXPECT_GT(seen.counts.late, 3) << fault;
    const int64_t given = static_cast<int64_t>(seen.frames.size());
    if (fault == "double")
      EXPECT_EQ(given, kFrames);
    else
      EXPECT_EQ(given + seen.counts.late, kFrames) << fault;
  }
}

TEST_F(FakeDevice, AStallHoldsFramesBackAndThenGivesThemAtOnce) {
  const Seen seen = play("stall=0.5@0.5&speed=10");
  EXPECT_EQ(seen.frames.size(), static_cast<size_t>(kFrames));
  EXPECT_EQ(seen.counts.late, 0);
}

TEST_F(FakeDevice, UnplugIsAStateAndTheFramesOfThatTimeAreGone) {
  const Seen seen = play("unplug=0.5,0.5&speed=10");
  EXPECT_EQ(seen.unplugged, 1);
  EXPECT_EQ(seen.frames.size(), static_cast<size_t>(kFrames - 15));
}

TEST_F(FakeDevice, WrongPlacesNameTheKeyAndTheKnownOnes) {
  const auto error = [](const std::string& where) { return test::input_error_of([&] { parse_fake_place(where); }); };
  EXPECT_EQ(error("fake:x?drp=1"),
            "fake: unknown parameter \"drp\" (did you mean \"drop\"?); known: drop, double, swap, late, stall, unplug, "
            "seed, speed");
  EXPECT_EQ(error("fake:x?drop=2"), "fake: drop=2: must be a share of the frames, 0 ... 1");
  EXPECT_EQ(error("fake:x?unplug=a,b"), "fake: unplug=a,b: must be AT,FOR, both in seconds");
  EXPECT_EQ(error("fake:x?stall=3"),
            "fake: stall=3: must be SECONDS@AT, both in seconds, or a share of the frames, 0 ... 1");
  EXPECT_EQ(error("fake:x?seed=-1"), "fake: seed=-1: must be a whole number of at least 0");
  EXPECT_EQ(error("fake:"), "fake: names no folder; give fake:FOLDER");
  EXPECT_NE(test::input_error_of([] { open_fake_device("fake:/no/such", {}); }).find("/no/such: no such folder"),
            std::string::npos);
  const FakePlace place = parse_fake_place("fake:a/b?stall=2@5&unplug=3,4&late=0.5&speed=2");
  EXPECT_EQ(place.folder, "a/b");
  EXPECT_EQ(place.faults.stall_for, 2);
  EXPECT_EQ(place.faults.stall_at, 5);
  EXPECT_EQ(place.faults.unplug_for, 4);
}

TEST(FakePlace, MutatedPlacesThrowNothingButInputErrors) {
  Random random(17);
  for (int i = 0; i < 5000; ++i) {
    try {
      parse_fake_place(mutated("fake:data/scene?drop=0.1&double=0.1&stall=2@5&unplug=3,4&seed=7&speed=2", random));
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace dkb
