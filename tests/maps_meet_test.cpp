// SPDX-License-Identifier: Apache-2.0
// A camera that was blind for a while begins a new map where it does not know its surroundings.
#include <gtest/gtest.h>

#include "e2e_support.h"

namespace dkb::test {
namespace {

// Thirty seconds, of which `blackout` [s, s] are dark.
std::filesystem::path walk(const TempFolder& temp, const std::string& scene, const std::string& blackout) {
  return simulated(temp / scene, {"--scene", scene, "--rate", "10", "--frames", "300", "--size", "320", "240", "--seed",
                                  "1", "--blackout=" + blackout});
}

// The two rooms differ in a tenth of their details: before the dark the camera has seen the one, and then the other.
TEST(MapsThatMeet, OfRoomsThatLookAlikeStayTwo) {
  const TempFolder temp;
  const SlamRun run(walk(temp, "twins", "10,9.4"), temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats["maps"], 2);
  EXPECT_EQ(run.stats["merges"], 0);
  EXPECT_EQ(run.stats["relocalisations"], 0);
}

// The camera comes back to where it began.
TEST(MapsThatMeet, OfOnePlaceBecomeOne) {
  const TempFolder temp;
  const auto sequence = walk(temp, "loop", "5,4");
  const SlamRun run(sequence, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats["maps"], 1);
  EXPECT_EQ(run.stats["merges"], 1);
  EXPECT_LT(ape_of(sequence, run.out / "trajectory.txt"), 0.05);
  const SlamRun single(sequence, temp / "single", {"--threads", "1"});
  for (const char* name : {"trajectory.txt", "map.dkb"})
    EXPECT_TRUE(read_text(run.out / name) == read_text(single.out / name)) << name;
}

}  // namespace
}  // namespace dkb::test
