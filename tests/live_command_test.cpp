// SPDX-License-Identifier: Apache-2.0
// `dkb-slam live`, `record` and `sources`, as their users start them. The camera is a played folder.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "e2e_support.h"

namespace dkb::test {
namespace {

std::string fake(const std::string& parameters = "") {
  return "fake:" + sequence().string() + (parameters.empty() ? "" : "?" + parameters);
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(LiveCommand, TracksACameraThatDropsRepeatsAndIsUnplugged) {
  const TempFolder temp;
  const Finished finished =
      run_program({"live", fake("drop=0.05&double=0.1&swap=0.05&late=0.05&stall=0.1@0.3&unplug=0.6,0.1&speed=0.5"),
                   "--detector", "none", "--out", (temp / "out").string()});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_TRUE(contains(finished.err, "the camera is gone; waiting for it to come back")) << finished.err;
  EXPECT_TRUE(contains(finished.out, "late or repeated; unplugged 1 time")) << finished.out;
  const auto stats = nlohmann::json::parse(read_text(temp / "out" / "stats.json"));
  EXPECT_GT(stats["tracked"].get<int>(), 20);
  EXPECT_LT(ape_of(sequence(), temp / "out" / "trajectory.txt"), 0.02);
}

TEST(LiveCommand, CtrlCEndsItWithEverythingWritten) {
  const TempFolder temp;
  Program program({"live", fake("speed=0.05"), "--detector", "none", "--out", (temp / "out").string()});
  std::this_thread::sleep_for(std::chrono::seconds(4));
  kill(program.pid(), SIGINT);
  const Finished finished = program.wait();
  EXPECT_EQ(finished.exit_code, 130) << finished.err;
  for (const char* name : {"trajectory.txt", "stats.json", "map.dkb"})
    EXPECT_TRUE(std::filesystem::exists(temp / "out" / name)) << name;
}

TEST(LiveCommand, CtrlCEndsTheWaitForACameraThatIsGone) {
  const TempFolder temp;
  Program program({"live", fake("unplug=0.2,1000&speed=0.2"), "--detector", "none", "--out", (temp / "out").string()});
  std::this_thread::sleep_for(std::chrono::seconds(3));
  kill(program.pid(), SIGINT);
  EXPECT_EQ(program.wait().exit_code, 130);
  EXPECT_TRUE(std::filesystem::exists(temp / "out" / "trajectory.txt"));
}

TEST(LiveCommand, WrongDevicesAreBadUsage) {
  for (const std::string& where :
       std::vector<std::string>{fake("drp=0.1"), std::string("v4l2:0"), std::string("v4l2:97,98"),
                                std::string("fake:/no/such/folder"), std::string("realsense:no such serial")}) {
    const Finished finished = run_program({"live", where});
    EXPECT_EQ(finished.exit_code, 2) << where;
    EXPECT_EQ(finished.error_lines(), 1u) << finished.err;
  }
}

TEST(LiveCommand, FramesThatAreDroppedAreToldOfWithAPriorFileToo) {
  const TempFolder temp;
  // The first frame waits for its detection; meanwhile more come than the queue holds.
  const Finished finished = run_program(
      {"live", fake("speed=100"), "--detector", "exec:sleep 2; echo answer 0 0; echo end; cat >/dev/null",
       "--no-record", "--out", (temp / "out").string(), "--prior-file", (sequence() / "groundtruth.txt").string()});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  const auto stats = nlohmann::json::parse(read_text(temp / "out" / "stats.json"));
  const bool dropped = stats["realtime"]["dropped"].get<int>() > 0;
  EXPECT_EQ(dropped, contains(finished.err, "one before it was dropped")) << finished.err;
}

TEST(LiveCommand, TheUnitOfTimesIsRefusedSinceACameraGivesNoImageTwice) {
  const TempFolder temp;
  const Finished finished = run_program({"run", fake(), "--cv-orb", "--out", (temp / "out").string()});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_TRUE(contains(finished.err, "error: --cv-orb: ")) << finished.err;
}

TEST(RecordCommand, ItsWarningsAreCalledSoOnce) {
  const TempFolder temp;
  const Finished finished = run_program({"record", fake("unplug=0.3,0.1&speed=0.5"), "--out", (temp / "out").string()});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_TRUE(contains(finished.err, "warning: the camera is gone")) << finished.err;
  EXPECT_FALSE(contains(finished.err, "warning: warning: ")) << finished.err;
}

TEST(RecordCommand, AFolderInThePlaceOfTheFileIsRefusedBeforeTheRecording) {
  const TempFolder temp;
  std::filesystem::create_directory(temp / "file.mcap");
  const Finished finished = run_program({"record", fake(), "--out", (temp / "file.mcap").string()});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_TRUE(contains(finished.err, "is a folder")) << finished.err;
}

TEST(RecordCommand, WhatWasRecordedReadsBackTheSame) {
  const TempFolder temp;
  const SlamRun original(sequence(), temp / "original");
  for (const std::string name : {"folder", "file.mcap"}) {
    const Finished finished = run_program({"record", fake("speed=0.3"), "--out", (temp / name).string()});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    EXPECT_TRUE(contains(finished.out, std::to_string(kSequenceFrames) + " frames, depth ")) << finished.out;
    const SlamRun run(temp / name, temp / ("of_" + name));
    EXPECT_EQ(read_text(run.out / "trajectory.txt"), read_text(original.out / "trajectory.txt")) << name;
  }
}

TEST(SourcesCommand, ListsEveryKind) {
  const Finished finished = run_program({"sources"});
  EXPECT_EQ(finished.exit_code, 0);
  for (const char* kind : {"fake:FOLDER", "v4l2:COLOUR,DEPTH", "openni2[:URI]", "realsense[:SERIAL]", "orbbec[:SERIAL]",
                           "FILE.bag", "FILE.mcap", "FILE.oni", "FOLDER"})
    EXPECT_TRUE(contains(finished.out, kind)) << finished.out;
}

}  // namespace
}  // namespace dkb::test
