// SPDX-License-Identifier: Apache-2.0
// A detector in a process of its own, end to end.
#include <gtest/gtest.h>

#include <cstdlib>

#include "e2e_support.h"

namespace dkb::test {
namespace {

// Finds the same person in `images` images.
std::string finds_one(int images) {
  return "for i in $(seq " + std::to_string(images) +
         "); do read -r word n stamp w h || exit; head -c $((w * h * 3)) >/dev/null; echo answer $n 1; "
         "echo person 0.9 200 100 150 300; echo end; done";
}

TEST(ExecRun, TheSameAnswersGiveTheSameBytes) {
  const TempFolder temp;
  const std::vector<std::string> detector = {"--detector", "motion+exec:" + finds_one(1000), "--detect-every", "2"};
  std::vector<std::string> on_one_thread = detector;
  on_one_thread.insert(on_one_thread.end(), {"--threads", "1"});
  const SlamRun first(sequence(), temp / "first", detector), again(sequence(), temp / "again", on_one_thread);
  for (const SlamRun* run : {&first, &again}) {
    ASSERT_EQ(run->finished.exit_code, 0) << run->finished.err;
    EXPECT_EQ(run->finished.err.find("warning"), std::string::npos) << run->finished.err;
    EXPECT_NE(run->stats.at("detector").at("kind").get<std::string>().find("exec"), std::string::npos);
    EXPECT_NEAR(run->stats.at("detector").at("rate_hz").get<double>(), 15, 1);
  }
  for (const char* name : {"trajectory.txt", "keyframes.txt", "map.dkb", "movers.csv"})
    EXPECT_TRUE(read_text(first.out / name) == read_text(again.out / name)) << name << " differs";
}

TEST(ExecRun, ACommandThatFailsIsOneWarningAndTheRunGoesOn) {
  const std::pair<std::string, const char*> failures[] = {
      {finds_one(3) + "; exit 5", "it ended"},
      {"echo loading the model; cat >/dev/null",
       "it answered \"loading the model\" where answer 0 COUNT was expected"}};
  for (const auto& [command, reason] : failures) {
    const TempFolder temp;
    const SlamRun run(sequence(), temp / "out", {"--detector", "exec:" + command});
    ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
    EXPECT_EQ(run.stats.at("tracked"), kSequenceFrames);
    EXPECT_TRUE(run.stats.at("detector").value("failed", false));
    const size_t at = run.finished.err.find("warning");
    EXPECT_NE(run.finished.err.find(reason), std::string::npos) << run.finished.err;
    EXPECT_NE(run.finished.err.find("it is not asked again"), std::string::npos) << run.finished.err;
    EXPECT_EQ(run.finished.err.find("warning", at + 1), std::string::npos) << run.finished.err;
  }
}

TEST(ExecRun, ACommandThatIsNotThereIsRefusedBeforeAnyFrame) {
  const TempFolder temp;
  for (const char* threads : {"0", "1"}) {
    const SlamRun run(sequence(), temp / "out",
                      {"--detector", "exec:no-such-command-anywhere --fast", "--quiet", "--threads", threads});
    EXPECT_EQ(run.finished.exit_code, 2) << run.finished.err;
    EXPECT_NE(
        run.finished.err.find("error: --detector exec: \"no-such-command-anywhere --fast\" cannot be started (exit "
                              "status 127: the shell finds no such command); give a command"),
        std::string::npos)
        << run.finished.err;
    EXPECT_EQ(run.finished.err.find("warning"), std::string::npos) << run.finished.err;
    EXPECT_FALSE(std::filesystem::exists(run.out)) << "nothing was tracked";
  }
}

TEST(ExecRun, ACommandThatEndsBeforeItsFirstAnswerIsRefusedBeforeAnyFrame) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--detector", "exec:read -r line; exit 1", "--quiet"});
  EXPECT_EQ(run.finished.exit_code, 2) << run.finished.err;
  EXPECT_NE(run.finished.err.find("error: --detector exec: \"read -r line; exit 1\" ended (exit status 1) before its "
                                  "first answer; what it wrote to its standard error says why"),
            std::string::npos)
      << run.finished.err;
}

// Orange of 10 x 5 px, from (3, 2) on.
TEST(ExecRun, TheExampleFindsWhatIsOrange) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0) GTEST_SKIP() << "skipped: no numpy";
  const TempFolder temp;
  std::string pixels(3 * 20 * 10, '\x40');
  for (int y = 2; y < 7; ++y)
    for (int x = 3; x < 13; ++x) pixels.replace(static_cast<size_t>(3 * (20 * y + x)), 3, "\xF0\x90\x20");
  write_text(temp / "frames", "frame 0 5 20 10\n" + pixels + "frame 1 6 1 1\n\x40\x40\x40");
  const std::string script = DKB_SOURCE_DIR "/examples/python/exec_detector.py";
  ASSERT_EQ(std::system(
                ("/usr/bin/python3 " + script + " <" + (temp / "frames").string() + " >" + (temp / "answers").string())
                    .c_str()),
            0);
  EXPECT_EQ(read_text(temp / "answers"),
            "answer 0 1\narm 1 3 2 10 5\nmask 43 10 10 10 10 10 10 10 10 10 67\nend\nanswer 1 0\nend\n");
}

TEST(ExecRun, AnEmptyCommandIsRefused) {
  const TempFolder temp;
  const Finished run =
      run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "exec: "});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("give --detector exec:COMMAND"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace dkb::test
