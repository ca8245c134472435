// SPDX-License-Identifier: Apache-2.0
// Save, load, localise: a map that is used again.
#include <gtest/gtest.h>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/map/map_file.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// [m] largest distance between poses of the same stamp; nothing in common is infinitely far.
double apart(const fs::path& a, const fs::path& b) {
  const Trajectory first = read_trajectory(a), second = read_trajectory(b);
  double largest = -1;
  for (const StampedPose& p : first)
    for (const StampedPose& q : second)
      if (p.stamp == q.stamp)
        largest = std::max(largest, (p.world_from_cam.translation - q.world_from_cam.translation).norm());
  return largest < 0 ? 1e9 : largest;
}

class Localise : public ::testing::Test {
 protected:
  Localise() : mapped(sequence(), temp / "mapped", {"--max-frames", "30"}), map(mapped.out / "map.dkb") {}
  TempFolder temp;
  SlamRun mapped;
  fs::path map;
};

TEST_F(Localise, FromAnotherStartInTheMapsWorldAndTheMapStaysAsItIs) {
  ASSERT_EQ(mapped.finished.exit_code, 0) << mapped.finished.err;
  const std::string before = read_text(map);
  const SlamRun run(sequence(), temp / "localised", {"--load-map", map.string(), "--localize", "--start", "0.5"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats["lost"], 1) << "the second frame confirms where the first one was found";
  EXPECT_EQ(run.stats["tracked"].get<int>() + 1, run.stats["frames"]);
  EXPECT_EQ(run.stats["relocalisations"], 1);
  EXPECT_EQ(run.stats["maps"], 1);
  EXPECT_EQ(run.stats["keyframes"], mapped.stats["keyframes"]);
  EXPECT_LT(apart(run.out / "trajectory.txt", mapped.out / "trajectory.txt"), 0.02);
  EXPECT_EQ(read_text(map), before);
  EXPECT_FALSE(fs::exists(run.out / "map.dkb")) << "there is nothing new to save";
}

TEST_F(Localise, OrGoOnAndExtendTheMap) {
  const SlamRun run(sequence(), temp / "extended", {"--load-map", map.string(), "--start", "0.5"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats["tracked"].get<int>() + 1, run.stats["frames"]);
  EXPECT_LT(apart(run.out / "trajectory.txt", mapped.out / "trajectory.txt"), 0.02);
  const MapFile saved = load_map(map), extended = load_map(run.out / "map.dkb");
  EXPECT_EQ(extended.map.roots(), std::vector<KeyframeId>{0});
  EXPECT_EQ(extended.map.keyframe_count(),
            saved.map.keyframe_count() + run.stats["keyframes_inserted"].get<KeyframeId>());
}

TEST_F(Localise, WithAMapOfAnotherCameraOrWithNoneIsRefused) {
  MapFile foreign = load_map(map);
  foreign.context.camera.fx += 1;
  save_map(temp / "foreign.dkb", foreign.map, foreign.context);
  const SlamRun other(sequence(), temp / "a", {"--load-map", (temp / "foreign.dkb").string(), "--localize"});
  EXPECT_EQ(other.finished.exit_code, 2);
  EXPECT_NE(other.finished.err.find("another camera"), std::string::npos);
  EXPECT_EQ(other.finished.error_lines(), 1U);
  const SlamRun none(sequence(), temp / "b", {"--localize"});
  EXPECT_EQ(none.finished.exit_code, 2);
  EXPECT_NE(none.finished.err.find("--load-map"), std::string::npos);
  write_text(temp / "damaged.dkb", read_text(map).substr(0, 5000));
  const SlamRun damaged(sequence(), temp / "c", {"--load-map", (temp / "damaged.dkb").string()});
  EXPECT_EQ(damaged.finished.exit_code, 2);
  EXPECT_EQ(damaged.finished.error_lines(), 1U);
}

TEST_F(Localise, WithADenseMapIsRefusedAndKeepsAnEarlierOne) {
  fs::create_directory(temp / "out");
  write_text(temp / "out" / "dense.ply", "earlier");
  const SlamRun run(sequence(), temp / "out", {"--load-map", map.string(), "--localize", "--dense"});
  EXPECT_EQ(run.finished.exit_code, 2);
  EXPECT_NE(run.finished.err.find("--dense: --localize"), std::string::npos) << run.finished.err;
  EXPECT_EQ(run.finished.error_lines(), 1U);
  EXPECT_EQ(read_text(temp / "out" / "dense.ply"), "earlier");
}

TEST_F(Localise, MapsThatMeetAreMergedInTheWorldOfTheFirst) {
  const SlamRun second(sequence(), temp / "second", {"--start", "0.4"});
  ASSERT_EQ(second.finished.exit_code, 0) << second.finished.err;
  const fs::path both = temp / "both.dkb";
  const Finished merged =
      run_program({"map", "merge", map.string(), (second.out / "map.dkb").string(), "--out", both.string()});
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  const MapFile a = load_map(map), b = load_map(second.out / "map.dkb"), joined = load_map(both);
  EXPECT_EQ(joined.map.roots(), std::vector<KeyframeId>{0});
  EXPECT_LT(joined.map.point_count(), a.map.point_count() + b.map.point_count()) << "what both saw is one";
  const SlamRun run(sequence(), temp / "in_both", {"--load-map", both.string(), "--localize"});
  EXPECT_EQ(run.stats["tracked"], kSequenceFrames - 1);
  EXPECT_LT(apart(run.out / "trajectory.txt", mapped.out / "trajectory.txt"), 0.03);
}

TEST_F(Localise, TheLibraryLoadsMapsLikewise) {
  const auto source = open_folder(sequence());
  Slam slam(source->camera()), first(source->camera());
  first.localize_only(true);
  slam.load_map(map);
  slam.localize_only(true);
  const int keyframes = slam.map().keyframe_count();
  EXPECT_EQ(keyframes, mapped.stats["keyframes"]);
  for (SourceFrame next = source->next(); next.state == SourceState::frame; next = source->next()) {
    const FrameResult in_map = slam.process(next.frame), in_none = first.process(next.frame);
    EXPECT_EQ(in_map.state, next.index == 0   ? TrackingState::lost
                            : next.index == 1 ? TrackingState::relocalised
                                              : TrackingState::tracking);
    EXPECT_EQ(in_none.state, TrackingState::initialising) << "localise-only starts no map";
    if (next.index == 1) {
      EXPECT_LT(in_map.odom_from_cam->translation.norm(), 1e-9) << "odometry begins where it is";
    }
  }
  slam.finish();
  EXPECT_EQ(slam.map().keyframe_count(), keyframes);
  EXPECT_EQ(first.map().keyframe_count(), 0);
  for (const TrajectoryFrame& k : slam.keyframes()) EXPECT_LT(k.frame, 0) << "keyframes of an earlier session";
}

}  // namespace
}  // namespace dkb::test
