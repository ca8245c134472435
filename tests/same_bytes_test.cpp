// SPDX-License-Identifier: Apache-2.0
// The same command in another process gives the same bytes, wherever the memory happens to be: what is ordered by
// addresses, hashes of addresses or memory that nobody set differs from process to process, not within one.
#include <gtest/gtest.h>

#include "e2e_support.h"
#include "people_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

const char* const kFiles[] = {"trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.dkb",    "map.ply",
                              "movers.csv",     "features.csv",          "debug.log",     "config.yaml"};

void expect_same(const SlamRun& a, const SlamRun& b, const std::string& how) {
  ASSERT_EQ(b.finished.exit_code, 0) << b.finished.err;
  for (const char* name : kFiles)
    EXPECT_TRUE(read_text(a.out / name) == read_text(b.out / name)) << name << " differs: " << how;
}

void expect_in_any_process(const fs::path& dataset, Arguments arguments) {
  const TempFolder temp;
  arguments.insert(arguments.end(), {"--dump-features", "--debug-log", "--max-frames", "60"});
  const SlamRun first(dataset, temp / "first", arguments);
  ASSERT_EQ(first.finished.exit_code, 0) << first.finished.err;
  ASSERT_GT(first.stats.at("keyframes"), 2);
  // Memory holds 0x5A or 0xA5 where nobody wrote. In one process large blocks are mapped one by one, each below the one
  // before; in the other all threads share one heap. The stacks begin elsewhere.
  const Arguments mapped = {"MALLOC_PERTURB_=165", "MALLOC_MMAP_THRESHOLD_=4096", "MALLOC_MMAP_MAX_=1000000",
                            "DKB_PADDING=" + std::string(50000, 'x')};
  const Arguments packed = {"MALLOC_PERTURB_=90", "MALLOC_ARENA_MAX=1", "MALLOC_TOP_PAD_=50000000",
                            "DKB_PADDING=" + std::string(7777, 'x')};
  expect_same(first, SlamRun(dataset, temp / "again", arguments), "the same command again");
  expect_same(first, SlamRun(dataset, temp / "mapped", arguments, mapped), "memory elsewhere");
  arguments.insert(arguments.end(), {"--threads", "1"});
  expect_same(first, SlamRun(dataset, temp / "packed", arguments, packed), "memory elsewhere, one thread");
}

TEST(SameBytes, InAnyProcessWithoutPeople) {
  expect_in_any_process(sequence(), {"--detector", "none"});
}

class SameBytesWithPeople : public ::testing::TestWithParam<const char*> {};

TEST_P(SameBytesWithPeople, InAnyProcess) {
  const Arguments detector = people_detector(GetParam());
  if (detector.empty()) GTEST_SKIP() << no_people_detector(GetParam());
  expect_in_any_process(people_sequence(), detector);
}

INSTANTIATE_TEST_SUITE_P(By, SameBytesWithPeople,
                         ::testing::Values("nothing", "motion", "boxes", "masks", "motion_with_boxes",
                                           "yolov5n_320x256", "yolov5n_320x256_by_opencv"),
                         [](const auto& p) { return std::string(p.param); });

}  // namespace
}  // namespace dkb::test
