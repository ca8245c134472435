// SPDX-License-Identifier: Apache-2.0
// `dkb-slam run --dense`, as its users start it.
#include <gtest/gtest.h>

#include <sstream>

#include "e2e_support.h"

namespace dkb::test {
namespace {

Finished run_dense(const std::filesystem::path& out, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {"run",    sequence().string(), "--out", out.string(), "--detector", "none",
                                        "--dense"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program(arguments);
}

TEST(RunDense, WritesAMeshAndAGridThatFitTogether) {
  const TempFolder temp;
  const Finished run = run_dense(temp / "out");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("dense map: "), std::string::npos) << run.out;

  const std::string ply = read_text(temp / "out" / "dense.ply");
  std::istringstream header(ply.substr(0, ply.find("end_header\n")));
  size_t vertices = 0, faces = 0;
  for (std::string line; std::getline(header, line);) {
    if (line.starts_with("element vertex ")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
  }
  EXPECT_GT(vertices, 1000U);
  EXPECT_GT(faces, 1000U);
  EXPECT_EQ(ply.size(), ply.find("end_header\n") + 11 + 15 * vertices + 13 * faces);

  const std::string pgm = read_text(temp / "out" / "occupancy.pgm");
  std::istringstream in(pgm);
  std::string magic;
  size_t width = 0, height = 0, largest = 0;
  in >> magic >> width >> height >> largest;
  in.get();
  EXPECT_EQ(magic, "P5");
  EXPECT_EQ(pgm.size(), static_cast<size_t>(in.tellg()) + width * height);
  EXPECT_NE(pgm.find('\0'), std::string::npos) << "something is occupied";
  EXPECT_NE(pgm.find('\xFE'), std::string::npos) << "something is free";
  EXPECT_NE(read_text(temp / "out" / "occupancy.yaml").find("image: occupancy.pgm\n"), std::string::npos);
}

TEST(RunDense, ADenseMapThatCannotBeWrittenLosesNoOtherResult) {
  const TempFolder temp;
  std::filesystem::create_directories(temp / "out");
  std::filesystem::create_symlink(temp / "none" / "dense.ply", temp / "out" / "dense.ply");
  const Finished run = run_dense(temp / "out");
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("dense.ply: cannot be written"), std::string::npos) << run.err;
  for (const char* name : {"trajectory.txt", "map.dkb", "stats.json", "report.html"})
    EXPECT_TRUE(std::filesystem::exists(temp / "out" / name)) << name;
}

TEST(RunDense, OneThreadGivesTheSameBytesAndTheRunIsTheSameAsWithout) {
  const TempFolder temp;
  ASSERT_EQ(run_dense(temp / "a").exit_code, 0);
  ASSERT_EQ(run_dense(temp / "b", {"--threads", "1"}).exit_code, 0);
  for (const char* name : {"dense.ply", "occupancy.pgm", "occupancy.yaml"})
    EXPECT_TRUE(read_text(temp / "a" / name) == read_text(temp / "b" / name)) << name;
  ASSERT_EQ(run_program({"run", sequence().string(), "--out", (temp / "c").string(), "--detector", "none"}).exit_code,
            0);
  EXPECT_FALSE(std::filesystem::exists(temp / "c" / "dense.ply"));
  for (const char* name : {"trajectory.txt", "map.dkb"})
    EXPECT_TRUE(read_text(temp / "a" / name) == read_text(temp / "c" / name)) << name;
}

TEST(RunDense, WrongSettingsAreNamed) {
  const TempFolder temp;
  const Finished run = run_dense(temp / "out", {"--set", "dense.voxel=3"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("dense.voxel"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace dkb::test
