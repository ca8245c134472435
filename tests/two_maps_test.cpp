// SPDX-License-Identifier: Apache-2.0
// A run whose camera turns up in another world: two maps that are never joined, and what the results say of that.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/image_codecs.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

constexpr int kFirst = 20, kSecond = 20;  // frames

// The sequence's first frames, then those after them as a mirror shows them: no place of theirs looks like one before.
void write_two_worlds(const fs::path& folder) {
  copy_sequence(folder, kFirst + kSecond, true);
  const CameraModel camera = choose_camera("", folder).camera;
  int row_number = 0;
  for (const auto& row : rows_of(folder / "associations.txt")) {
    if (row_number++ < kFirst) continue;
    ColourImage colour = read_picture(folder / row[1]).colour;
    const DepthImage metres = read_depth(folder / row[3], camera);
    Image<uint16_t> depth(metres.width(), metres.height());
    for (int y = 0; y < metres.height(); ++y) {
      std::reverse(&colour(0, y), &colour(0, y) + colour.width());
      for (int x = 0; x < metres.width(); ++x)
        depth(metres.width() - 1 - x, y) = static_cast<uint16_t>(std::lround(metres(x, y) * camera.depth_factor));
    }
    write_text(folder / row[1], encode_jpeg(colour));
    write_text(folder / row[3], encode_png(depth, 1));
  }
}

size_t vertices_of(const fs::path& ply) {
  const std::string text = read_text(ply);
  return std::stoul(text.substr(text.find("element vertex ") + 15));
}

// Of a mesh.
Eigen::Vector3d middle_of(const fs::path& ply) {
  const std::string text = read_text(ply);
  const size_t start = text.find("end_header\n") + 11, count = vertices_of(ply);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < count; ++i) {
    float p[3];
    std::memcpy(p, text.data() + start + 15 * i, sizeof p);
    sum += Eigen::Vector3d(p[0], p[1], p[2]);
  }
  return sum / static_cast<double>(count);
}

TEST(TwoMaps, EveryResultSaysWhichOfThemItIsOf) {
  const TempFolder temp;
  write_two_worlds(temp / "data");
  const Finished told_run = run_program({"run", (temp / "data").string(), "--detector", "none", "--out",
                                         (temp / "out").string(), "--dense", "--set", "tracking.new_map_after=0.1"});
  ASSERT_EQ(told_run.exit_code, 0) << told_run.err;
  const fs::path results = temp / "out";
  const auto stats = nlohmann::json::parse(read_text(results / "stats.json"));
  ASSERT_EQ(stats["maps"], 2) << told_run.err;
  const size_t first = rows_of(results / "trajectory.txt").size(),
               second = rows_of(results / "trajectory_map2.txt").size();
  ASSERT_GE(first, 10U);
  ASSERT_GE(second, 10U);
  const std::string others = std::to_string(second) + " frames are in 1 map that was never joined: trajectory_map2.txt";
  EXPECT_NE(told_run.out.find("\n" + others + "; the APE is of " + std::to_string(first) + "\n"), std::string::npos)
      << told_run.out;
  EXPECT_NE(read_text(results / "report.html").find(others), std::string::npos);

  // The clouds.
  EXPECT_EQ(vertices_of(results / "map.ply") + vertices_of(results / "map_map2.ply"), stats["map_points"]);
  EXPECT_GT(vertices_of(results / "map_map2.ply"), 100U);

  // The dense map is nearer to that of the first frames alone than to that of the others.
  const SlamRun alone(temp / "data", temp / "alone", {"--dense", "--max-frames", std::to_string(kFirst)});
  const SlamRun rest(temp / "data", temp / "rest", {"--dense", "--skip-pairs", std::to_string(kFirst)});
  const Eigen::Vector3d middle = middle_of(results / "dense.ply");
  EXPECT_LT((middle - middle_of(alone.out / "dense.ply")).norm(), (middle - middle_of(rest.out / "dense.ply")).norm());

  // Exports.
  const auto told = [](const std::vector<std::string>& arguments) {
    const Finished done = run_program(arguments);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return done.out;
  };
  const std::string out = results.string(), map = (results / "map.dkb").string(), file = (temp / "file").string();
  EXPECT_NE(told({"export", out, "--format", "tum", "--out", file}).find("; left out: " + others), std::string::npos);
  EXPECT_NE(told({"map", "export", map, "--format", "ply", "--out", file})
                .find("; left out: 1 map that was never joined to it, with "),
            std::string::npos);
  EXPECT_EQ(vertices_of(file), vertices_of(results / "map.ply"));

  // A later run into the same folder leaves nothing of the second map there.
  ASSERT_EQ(SlamRun(temp / "data", results, {"--max-frames", "12"}).finished.exit_code, 0);
  EXPECT_FALSE(fs::exists(results / "map_map2.ply"));
  EXPECT_FALSE(fs::exists(results / "trajectory_map2.txt"));

  // What is found in the second map of a file alone is said, since trajectory.txt holds nothing then.
  const SlamRun again(temp / "data", temp / "again", {"--set", "tracking.new_map_after=0.1"});
  const Finished localised =
      run_program({"run", (temp / "data").string(), "--detector", "none", "--out", (temp / "localised").string(),
                   "--start", "0.9", "--load-map", (again.out / "map.dkb").string(), "--localize"});
  EXPECT_EQ(localised.exit_code, 0) << localised.err;
  EXPECT_TRUE(rows_of(temp / "localised" / "trajectory.txt").empty());
  EXPECT_NE(localised.out.find("trajectory.txt holds no pose: "), std::string::npos) << localised.out;
}

}  // namespace
}  // namespace dkb::test
