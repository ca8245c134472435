// SPDX-License-Identifier: Apache-2.0
// How commands end: by signals, with outputs that cannot be written, and in a folder that has been used before.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>

#include "dkb/dataset/image_codecs.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

bool wait_for_first_frame(Program& program) {
  while (program.err().find("frame 1/20") == std::string::npos && !program.ended()) pause_ms(5);
  return !program.ended();
}

TEST(RunEnding, ATerminalThatGoesAwayEndsARunWithItsResults) {
  std::signal(SIGHUP, SIG_DFL);
  const TempFolder temp;
  const Endless endless(temp / "endless");
  Program program(endless.run(temp / "out"));
  ASSERT_TRUE(wait_for_first_frame(program));
  kill(program.pid(), SIGHUP);
  while (!program.ended()) endless.let_go(), pause_ms(5);
  EXPECT_EQ(program.wait().exit_code, 130);
  EXPECT_TRUE(fs::exists(temp.path() / "out" / "stats.json"));
}

TEST(RunEnding, ARunUnderNohupOutlivesItsTerminal) {
  std::signal(SIGHUP, SIG_IGN);
  const TempFolder temp;
  const Endless endless(temp / "endless");
  Program program(endless.run(temp / "out"));
  std::signal(SIGHUP, SIG_DFL);
  ASSERT_TRUE(wait_for_first_frame(program));
  kill(program.pid(), SIGHUP);
  while (!program.ended()) endless.let_go(), pause_ms(5);
  EXPECT_EQ(program.wait().exit_code, 0);
}

TEST(RunEnding, ASecondInterruptEndsItAtOnce) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  std::vector<std::string> arguments = endless.run(temp / "out");
  arguments.insert(arguments.end(), {"--threads", "1"});  // the pipe holds up the run itself
  Program program(arguments);
  const int pipe = endless.hold_up(program);
  ASSERT_GE(pipe, 0);
  kill(program.pid(), SIGINT);
  pause_ms(50);
  kill(program.pid(), SIGINT);  // the same press, told twice
  pause_ms(600);
  ASSERT_FALSE(program.ended());
  kill(program.pid(), SIGINT);
  EXPECT_EQ(program.wait().exit_code, 1000 + SIGINT);
  close(pipe);
}

TEST(RunEnding, OutputsThatCannotBeWrittenLoseNoResult) {
  const TempFolder temp;
  const std::string run = "@ run " + sequence().string() + " --detector none --max-frames 12 --out ";
  const auto complete = [&](const char* out) { return fs::exists(temp.path() / out / "report.html"); };
  EXPECT_EQ(shell(run + (temp / "a").string() + " >/dev/null 2>/dev/full"), 0);
  EXPECT_TRUE(complete("a"));
  EXPECT_EQ(shell(run + (temp / "b").string() + " >/dev/full"), 1);
  EXPECT_TRUE(complete("b"));
  EXPECT_EQ(shell("(" + run + (temp / "c").string() + " 2>&1; echo $? >" + (temp / "code").string() +
                  ") | head -c 10 >/dev/null"),
            0);
  EXPECT_TRUE(complete("c"));
  EXPECT_EQ(read_text(temp / "code"), "1\n");
  EXPECT_EQ(shell(run + (temp / "d").string() + " >&- 2>&-"), 1);
  EXPECT_TRUE(complete("d"));
  const std::string truth = (sequence() / "groundtruth.txt").string();
  EXPECT_EQ(shell("@ eval " + truth + " " + truth + " >/dev/full"), 1);
  EXPECT_EQ(shell("@ eval " + truth + " " + truth + " >/dev/null"), 0);
  EXPECT_EQ(shell("@ --help >/dev/full"), 1);
}

TEST(RunEnding, RowsOfFramesAreOnTheDiskBeforeTheRunEnds) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  std::vector<std::string> arguments = endless.run(temp / "out");
  arguments.insert(arguments.end(), {"--threads", "1", "--dump-features", "--dump-boxes", "--debug-log"});
  Program program(arguments);
  const int pipe = endless.hold_up(program);
  ASSERT_GE(pipe, 0);
  const std::vector<std::string> names = {"features.csv", "detections.txt", "debug.log", "movers.csv"};
  for (const std::string& name : names) EXPECT_TRUE(fs::exists(temp / "out" / (name + ".part"))) << name;
  EXPECT_GT(read_text(temp / "out" / "features.csv.part").size(), 50'000U);
  EXPECT_NE(read_text(temp / "out" / "debug.log.part").find(" frame 9 "), std::string::npos);
  kill(program.pid(), SIGKILL);
  program.wait();
  EXPECT_TRUE(fs::exists(temp / "out" / "features.csv.part")) << "one that is killed loses nothing";
  close(pipe);

  ASSERT_EQ(SlamRun(sequence(), temp / "out", {"--max-frames", "6", "--debug-log"}).finished.exit_code, 0);
  EXPECT_TRUE(fs::exists(temp / "out" / "debug.log"));
  EXPECT_TRUE(fs::exists(temp / "out" / "movers.csv"));
  for (const std::string& name : names) EXPECT_FALSE(fs::exists(temp / "out" / (name + ".part"))) << name;
}

TEST(RunEnding, AnInterruptedRunHasItsRowsOfFrames) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  std::vector<std::string> arguments = endless.run(temp / "out");
  arguments.push_back("--debug-log");
  Program program(arguments);
  ASSERT_TRUE(wait_for_first_frame(program));
  kill(program.pid(), SIGINT);
  while (!program.ended()) endless.let_go(), pause_ms(5);
  EXPECT_EQ(program.wait().exit_code, 130);
  const auto stats = nlohmann::json::parse(read_text(temp / "out" / "stats.json"));
  EXPECT_EQ(rows_of(temp / "out" / "debug.log").size(), stats["frames"]);
  EXPECT_TRUE(fs::exists(temp / "out" / "movers.csv"));
}

TEST(RunEnding, AFileOfRowsThatCannotBeWrittenIsGivenUpAndTheResultsAreWritten) {
  const TempFolder temp;
  const Finished run = run_program({"run", sequence().string(), "--detector", "none", "--max-frames", "30", "--out",
                                    (temp / "out").string(), "--dump-features"},
                                   300'000);
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("features.csv: cannot be written"), std::string::npos) << run.err;
  EXPECT_TRUE(fs::exists(temp / "out" / "trajectory.txt"));
  EXPECT_FALSE(fs::exists(temp / "out" / "features.csv.part"));
}

TEST(RunEnding, ARunThatFailsAtOnceLeavesNoFolder) {
  const TempFolder temp;
  const Finished run = run_program(
      {"run", sequence().string(), "--detector", "exec:/no/such/program", "--out", (temp / "new" / "out").string()});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_TRUE(fs::is_empty(temp.path()));
  EXPECT_NE(shell("cd " + temp.path().string() + " && @ run " + sequence().string() + " --detector exec:/no/such"), 0);
  EXPECT_TRUE(fs::is_empty(temp.path()));
}

TEST(RunEnding, AFolderThatCannotBeMadeIsABadInput) {
  const TempFolder temp;
  copy_sequence(temp / std::string(250, 'x'), 6, false);
  const std::string told = (temp / "told").string();
  EXPECT_EQ(shell("cd " + temp.path().string() + " && @ run " + std::string(250, 'x') + " --detector none 2>" + told),
            2);
  const std::string text = read_text(told);
  EXPECT_TRUE(text.starts_with("error: dkb-out/xxx")) << text;
  EXPECT_NE(text.find(": cannot make this output folder ("), std::string::npos) << text;
  EXPECT_NE(text.find("; choose another with --out\n"), std::string::npos) << text;
}

TEST(RunEnding, AFolderThatWasUsedBeforeHoldsNothingOfTheEarlierRun) {
  const TempFolder temp;
  const fs::path out = temp / "out";
  const std::vector<std::string> short_run = {"--max-frames", "12"};
  std::vector<std::string> all = {"--max-frames", "12",       "--dense", "--dump-features",
                                  "--debug-log",  "--cv-orb", "--record"};
  ASSERT_EQ(SlamRun(sequence(), out, all).finished.exit_code, 0);
  for (const char* name : {"dense.ply", "features.csv", "debug.log"}) ASSERT_TRUE(fs::exists(out / name)) << name;
  fs::copy_file(out / "map.dkb", temp / "map.dkb");
  const std::vector<std::string> of_maps = {"trajectory_map3.txt", "trajectory_online_map12.txt", "keyframes_map4.txt"};
  for (const std::string& name : of_maps) write_text(out / name, "earlier");
  write_text(out / "trajectory_map_notes.txt", "mine");
  ASSERT_EQ(SlamRun(sequence(), out, short_run).finished.exit_code, 0);
  for (const char* name :
       {"dense.ply", "occupancy.pgm", "occupancy.yaml", "session.dkbs", "features.csv", "debug.log", "cv_orb.json"})
    EXPECT_FALSE(fs::exists(out / name)) << name;
  for (const std::string& name : of_maps) EXPECT_FALSE(fs::exists(out / name)) << name;
  EXPECT_TRUE(fs::exists(out / "trajectory_map_notes.txt"));
  EXPECT_TRUE(fs::exists(out / "map.dkb"));
  std::vector<std::string> localising = {"--max-frames", "12", "--localize", "--load-map", (out / "map.dkb").string()};
  ASSERT_EQ(SlamRun(sequence(), out, localising).finished.exit_code, 0);
  EXPECT_TRUE(fs::exists(out / "map.dkb")) << "the map that it was found in";
  localising.back() = (temp / "map.dkb").string();
  ASSERT_EQ(SlamRun(sequence(), out, localising).finished.exit_code, 0);
  EXPECT_FALSE(fs::exists(out / "map.dkb"));
  EXPECT_FALSE(fs::exists(out / "map.ply"));
}

// As a second run of the same folder would mix its files with those of the first.
TEST(RunEnding, ASecondRunIntoTheSameFolderIsRefusedAtItsStart) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  Program first(endless.run(temp / "out"));
  ASSERT_TRUE(wait_for_first_frame(first));
  const Finished second =
      run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "none"});
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_EQ(second.err, "error: " + (temp / "out").string() +
                            ": another run is writing its results there; wait for it, or choose another folder\n");
  kill(first.pid(), SIGKILL);
  first.wait();
  EXPECT_EQ(SlamRun(sequence(), temp / "out", {"--max-frames", "6"}).finished.exit_code, 0) << "a crash leaves no lock";
  for (const auto& entry : fs::directory_iterator(temp / "out"))
    EXPECT_EQ(entry.path().filename().string().find("lock"), std::string::npos) << entry.path();
}

TEST(RunEnding, AFolderInThePlaceOfAResultIsRefusedBeforeTheRun) {
  const TempFolder temp;
  fs::create_directories(temp / "out" / "trajectory.txt");
  const Finished run =
      run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "none"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(run.err, "error: " + (temp / "out" / "trajectory.txt").string() +
                         ": is a folder, where runs write a file; remove it, or choose another --out\n");
  EXPECT_FALSE(fs::exists(temp / "out" / "movers.csv"));
}

TEST(RunEnding, AFolderThatVanishesWhileTheRunGoesOnIsAFailureAndNoBadInput) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  Program program(endless.run(temp / "out"));
  ASSERT_TRUE(wait_for_first_frame(program));
  fs::remove_all(temp / "out");
  kill(program.pid(), SIGINT);
  while (!program.ended()) endless.let_go(), pause_ms(5);
  const Finished run = program.wait();
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("trajectory.txt: cannot be written"), std::string::npos) << run.err;
}

TEST(RunEnding, RunsThatStartTogetherHaveFoldersOfTheirOwn) {
  const TempFolder temp;
  const std::string run = "@ run " + sequence().string() + " --detector none --max-frames 3 --quiet";
  ASSERT_EQ(shell("cd " + temp.path().string() + " && { " + run + " & " + run + " & " + run + "; wait; }"), 0);
  size_t folders = 0;
  for (const auto& entry : fs::directory_iterator(temp / "dkb-out")) {
    ++folders;
    EXPECT_TRUE(fs::exists(entry.path() / "report.html")) << entry.path();
  }
  EXPECT_EQ(folders, 3U);
}

TEST(RunEnding, OnATerminalWarningsAndErrorsHaveLinesOfTheirOwn) {
  const TempFolder temp;
  copy_sequence(temp / "data", 12, true);
  write_text(temp / "data" / rows_of(temp / "data/associations.txt")[6][1], "no image");
  const std::string warned = told_to_a_terminal("@ run " + (temp / "data").string() + " --detector none --out " +
                                                (temp / "out").string() + " >/dev/null");
  EXPECT_NE(warned.find("frame 1/12"), std::string::npos) << warned;
  EXPECT_NE(warned.find("\nwarning: frame 6"), std::string::npos) << warned;

  fs::create_directories(temp / "made/associations.txt/full");
  const std::string failed =
      told_to_a_terminal("@ simulate --size 64x64 --frames 2 --out " + (temp / "made").string() + " >/dev/null");
  EXPECT_NE(failed.find("frame 2 of 2"), std::string::npos) << failed;
  EXPECT_NE(failed.find("\nerror: "), std::string::npos) << failed;
}

TEST(RunEnding, WhyTheUnitOfTimesIsNotMeasuredIsTold) {
  const TempFolder temp;
  fs::copy_file(DKB_SLAM_EXECUTABLE, temp / "alone");
  const std::string told = (temp / "told").string();
  EXPECT_EQ(shell((temp / "alone").string() + " run " + sequence().string() +
                  " --detector none --max-frames 6 --cv-orb --quiet --out " + (temp / "out").string() + " 2>" + told),
            0);
  EXPECT_NE(read_text(told).find("warning: --cv-orb: not measured: this build has no libdkb_cv_orb.so ("),
            std::string::npos)
      << read_text(told);
  EXPECT_NE(read_text(temp / "out/cv_orb.json").find("null"), std::string::npos);
}

TEST(RunEnding, ARunWithoutAPoseKeepsAnEarlierMap) {
  const TempFolder temp;
  const fs::path out = temp / "out";
  ASSERT_EQ(SlamRun(sequence(), out, {"--max-frames", "12"}).finished.exit_code, 0);
  const std::string map = read_text(out / "map.dkb");
  const std::vector<std::string> blind = {"--max-frames", "12", "--set", "tracking.initial_points=8000"};
  EXPECT_EQ(SlamRun(sequence(), out, blind).finished.exit_code, 1);
  EXPECT_TRUE(read_text(out / "map.dkb") == map);
  EXPECT_TRUE(fs::exists(out / "map.ply"));
  EXPECT_EQ(SlamRun(sequence(), temp / "other", blind).finished.exit_code, 1);
  EXPECT_FALSE(fs::exists(temp / "other" / "map.dkb"));
}

TEST(RunEnding, APortThatIsTakenCostsNoEarlierRecording) {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&at), size), 0);
  ASSERT_EQ(listen(listener, 1), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&at), &size), 0);

  const TempFolder temp;
  fs::create_directory(temp / "out");
  write_text(temp / "out" / "session.dkbs", "earlier");
  const Finished run = run_program({"run", sequence().string(), "--detector", "none", "--out", (temp / "out").string(),
                                    "--record", "--viewer", std::to_string(ntohs(at.sin_port))});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_EQ(read_text(temp / "out" / "session.dkbs"), "earlier");
  close(listener);
}

TEST(RunEnding, AFolderInThePlaceOfTheSessionIsABadInput) {
  const TempFolder temp;
  fs::create_directories(temp / "out" / "session.dkbs");
  const Finished run =
      run_program({"run", sequence().string(), "--detector", "none", "--out", (temp / "out").string(), "--record"});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_EQ(run.error_lines(), 1U) << run.err;
}

TEST(RunEnding, WarningsOfTheEndAreToldEvenWhenResultsCannotBeWritten) {
  const TempFolder temp;
  fs::create_directories(temp / "out");
  fs::create_symlink(temp / "none" / "trajectory.txt", temp / "out" / "trajectory.txt");
  const double first = std::stod(rows_of(sequence() / "rgb.txt").at(0).at(0));
  // Poses too far apart to tell of the motion between them.
  write_text(temp / "wheels.txt",
             std::to_string(first - 100) + " 0 0 0 0 0 0 1\n" + std::to_string(first + 100) + " 0 0 0 0 0 0 1\n");
  const Finished run = run_program({"run", sequence().string(), "--detector", "none", "--max-frames", "12", "--out",
                                    (temp / "out").string(), "--prior-file", (temp / "wheels.txt").string()});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("tells of no frame's motion"), std::string::npos) << run.err;
}

TEST(RunEnding, CtrlCWhileTheResultsOfAWholeRunAreWrittenIsNoInterruption) {
  const TempFolder temp;
  fs::create_directory(temp / "out");
  Program program({"run", sequence().string(), "--detector", "none", "--out", (temp / "out").string()});
  // The file that the report grows in is a pipe, which holds up the run until somebody reads it: one of these, since a
  // run counts the files that it writes.
  std::vector<fs::path> pipes;
  for (int i = 1; i <= 200; ++i) {
    pipes.push_back(temp / "out" / (".report.html.tmp" + std::to_string(program.pid()) + "-" + std::to_string(i)));
    ASSERT_EQ(mkfifo(pipes.back().c_str(), 0600), 0);
  }
  while (!fs::exists(temp / "out" / "stats.json") && !program.ended()) pause_ms(5);
  ASSERT_FALSE(program.ended());
  kill(program.pid(), SIGINT);
  std::vector<int> fds;
  for (const fs::path& pipe : pipes) fds.push_back(open(pipe.c_str(), O_RDONLY | O_NONBLOCK));
  char bytes[4096];
  int pieces = 0;
  for (; !program.ended(); pause_ms(1))
    for (const int fd : fds)
      while (read(fd, bytes, sizeof bytes) > 0) ++pieces;
  for (const int fd : fds) close(fd);
  EXPECT_GT(pieces, 0) << "the report went by none of them";
  const Finished run = program.wait();
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out.find("interrupted"), std::string::npos) << run.out;
}

// What a run of 12 frames of the sequence says, changed by `change` [of a pair's colour and depth file].
template <class Change>
Finished run_changed(const fs::path& folder, const Change& change, std::vector<std::string> more = {}) {
  copy_sequence(folder / "data", 12, true);
  for (const auto& row : rows_of(folder / "data/associations.txt"))
    change(folder / "data" / row[1], folder / "data" / row[3]);
  std::vector<std::string> arguments = {
      "run", (folder / "data").string(), "--out", (folder / "out").string(), "--detector", "none"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program(arguments);
}

TEST(RunEnding, WhyTrackingNeverBeganIsToldByWhatTheImagesShow) {
  const TempFolder temp;
  const Finished black = run_changed(temp / "black", [](const fs::path& colour, const fs::path&) {
    write_text(colour, encode_png(GreyImage(640, 480, 0)));
  });
  EXPECT_EQ(black.exit_code, 1);
  EXPECT_NE(black.err.find("the images show 0 corners at most: are they black, covered or out of focus?"),
            std::string::npos)
      << black.err;
  const Finished empty = run_changed(temp / "empty", [](const fs::path&, const fs::path& depth) {
    write_text(depth, encode_png(Image<uint16_t>(640, 480, 0)));
  });
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_NE(empty.err.find("are there depth images"), std::string::npos) << empty.err;
  EXPECT_NE(empty.out.find("\ndepth: none in the first frame"), std::string::npos) << empty.out;
}

TEST(RunEnding, DepthsOfTheFirstFrameAreTold) {
  const TempFolder temp;
  const Finished run = run_changed(temp / "usual", [](const fs::path&, const fs::path&) {});
  EXPECT_NE(run.out.find("\ndepth "), std::string::npos) << run.out;
  EXPECT_NE(run.out.find(" m, median "), std::string::npos) << run.out;
  EXPECT_EQ(run.err.find("depth_factor"), std::string::npos) << run.err;
  const Finished near = run_changed(temp / "near",
                                    [](const fs::path&, const fs::path& depth) {
                                      write_text(depth, encode_png(Image<uint16_t>(640, 480, 1500)));  // 0.3 m
                                    },
                                    {"--camera", "fr1"});
  EXPECT_NE(
      near.err.find("warning: depth is 0.3 m in the median of the first frame: is the camera's depth_factor right "
                    "(5000 per metre"),
      std::string::npos)
      << near.err;
}

TEST(RunEnding, AMapThatTheCameraWasNeverFoundInIsNamed) {
  const TempFolder temp;
  ASSERT_EQ(SlamRun(sequence(), temp / "map", {"--max-frames", "12"}).finished.exit_code, 0);
  const std::string map = (temp / "map/map.dkb").string();
  const Finished lost = run_changed(
      temp / "other",
      [](const fs::path& colour, const fs::path&) { write_text(colour, encode_png(GreyImage(640, 480, 90))); },
      {"--load-map", map});
  EXPECT_EQ(lost.exit_code, 1);
  EXPECT_NE(lost.err.find("error: the camera was never found in " + map + "; a new map begins after 1 s without it"),
            std::string::npos)
      << lost.err;
}

TEST(RunEnding, TheLastLinesTellTheErrorAndTheReport) {
  const TempFolder temp;
  copy_sequence(temp / "data", 12, false);
  const auto run = [&] {
    return run_program({"run", (temp / "data").string(), "--detector", "none", "--out", (temp / "out").string()});
  };
  const Finished judged = run();
  EXPECT_NE(judged.out.find("\nAPE 0.00"), std::string::npos) << judged.out;
  EXPECT_NE(judged.out.find("report.html\n"), std::string::npos) << judged.out;
  write_text(temp.path() / "data" / "groundtruth.txt", "1 2 3\n");
  const Finished broken = run();
  EXPECT_EQ(broken.exit_code, 0);
  EXPECT_EQ(broken.out.find("APE"), std::string::npos) << broken.out;
  EXPECT_NE(broken.err.find("warning: " + (temp.path() / "data" / "groundtruth.txt").string() + ":1"),
            std::string::npos)
      << broken.err;
}

TEST(RunEnding, ASimulationIntoTheFolderOfALongerOneLeavesNoImageOfIt) {
  const TempFolder temp;
  const auto simulate = [&](const char* frames) {
    return run_program(
        {"simulate", "--out", (temp / "s").string(), "--size", "64x64", "--frames", frames, "--seed", frames});
  };
  ASSERT_EQ(simulate("5").exit_code, 0);
  write_text(temp / "s/rgb/mine.jpg", "mine");
  const Finished shorter = simulate("1");
  ASSERT_EQ(shorter.exit_code, 0);
  EXPECT_NE(shorter.out.find(": 1 frame of scene"), std::string::npos) << shorter.out;
  for (const char* images : {"rgb", "depth", "masks"})
    EXPECT_EQ(std::distance(fs::directory_iterator(temp / "s" / images), {}), images == std::string("rgb") ? 2 : 1);
}

TEST(RunEnding, WhatIsNoFolderIsNoOutputOfAConversion) {
  const TempFolder temp;
  for (const char* name : {"q.zip", "q.oni", "q.mp4"}) {
    const Finished done = run_program({"convert", sequence().string(), "--out", (temp / name).string()});
    EXPECT_EQ(done.exit_code, 2);
    EXPECT_NE(done.err.find("give FILE.bag, FILE.mcap or the name of a folder"), std::string::npos) << done.err;
    EXPECT_FALSE(fs::exists(temp / name));
  }
}

TEST(RunEnding, AMapIsNotMergedWithItself) {
  const TempFolder temp;
  ASSERT_EQ(SlamRun(sequence(), temp / "run", {"--max-frames", "12"}).finished.exit_code, 0);
  const std::string map = (temp / "run/map.dkb").string();
  const Finished done = run_program({"map", "merge", map, map, "--out", map});
  EXPECT_EQ(done.exit_code, 2);
  EXPECT_NE(done.err.find("is the same file as"), std::string::npos) << done.err;
}

TEST(RunEnding, AnInterruptedConversionExportOrSimulationLeavesNothing) {
  const TempFolder temp;
  const auto is_empty = [&] { return fs::is_empty(temp.path()); };
  Program simulating({"simulate", "--out", (temp / "made").string(), "--scene", "room"});
  while (!fs::exists(temp.path() / "made" / "rgb") && !simulating.ended()) pause_ms(5);
  kill(simulating.pid(), SIGINT);
  EXPECT_EQ(simulating.wait().exit_code, 130);
  EXPECT_TRUE(is_empty());

  Program converting({"convert", sequence().string(), "--out", (temp / "made.mcap").string()});
  while (is_empty() && !converting.ended()) pause_ms(1);
  kill(converting.pid(), SIGINT);
  EXPECT_EQ(converting.wait().exit_code, 130);
  EXPECT_TRUE(is_empty());

  const TempFolder results;
  const SlamRun run(sequence(), results / "run");
  Program exporting(
      {"export", run.out.string(), "--out", (temp / "made.mcap").string(), "--images", sequence().string()});
  while (is_empty() && !exporting.ended()) pause_ms(1);
  kill(exporting.pid(), SIGINT);
  EXPECT_EQ(exporting.wait().exit_code, 130);
  EXPECT_TRUE(is_empty());
}

}  // namespace
}  // namespace dkb::test
