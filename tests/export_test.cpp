// SPDX-License-Identifier: Apache-2.0
// Results in the formats of other tools: `map export` and `export`, as their users start them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "dkb/dataset/image_codecs.h"
#include "dkb/map/map_file.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

class Export : public ::testing::Test {
 protected:
  Export() : run(sequence(), folder / "run", {"--dump-features"}) {}
  Finished export_map(const std::string& format, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"map",  "export", (run.out / "map.dkb").string(), "--format",
                                          format, "--out",  (folder / format).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program(arguments);
  }
  TempFolder folder;
  SlamRun run;
};

std::vector<std::string> lines_of(const fs::path& file) {
  std::vector<std::string> lines;
  std::istringstream in(read_text(file));
  for (std::string line; std::getline(in, line);)
    if (!line.starts_with('#')) lines.push_back(line);
  return lines;
}

TEST_F(Export, ColmapsModelPutsItsPointsWhereItsImagesSeeThem) {
  const Finished done = export_map("colmap", {"--images", sequence().string(), "--detector", "none"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const fs::path sparse = folder / "colmap" / "sparse" / "0";
  const auto camera = rows_of(sparse / "cameras.txt").at(0);
  ASSERT_EQ(camera.at(1), "PINHOLE");
  const double fx = std::stod(camera.at(4)), fy = std::stod(camera.at(5)), cx = std::stod(camera.at(6)),
               cy = std::stod(camera.at(7));
  EXPECT_DOUBLE_EQ(cx, 320);  // the corner of the top-left pixel is the origin there

  struct SeenAt {
    Eigen::Vector3d in_cam;
    Eigen::Vector2d pixel;
  };
  std::map<std::string, Eigen::Vector3d> points;
  std::map<std::string, std::set<std::pair<int, int>>> tracks;
  for (const auto& row : rows_of(sparse / "points3D.txt")) {
    points[row[0]] = {std::stod(row[1]), std::stod(row[2]), std::stod(row[3])};
    for (size_t i = 8; i + 1 < row.size(); i += 2) tracks[row[0]].insert({std::stoi(row[i]), std::stoi(row[i + 1])});
  }
  ASSERT_GT(points.size(), 200U);
  const auto images = lines_of(sparse / "images.txt");
  ASSERT_EQ(images.size(), 2 * run.stats["keyframes"].get<size_t>());
  std::vector<double> errors;
  std::map<std::string, std::set<std::pair<int, int>>> seen;
  for (size_t i = 0; i < images.size(); i += 2) {
    std::istringstream head(images[i]), features(images[i + 1]);
    int id = 0, camera_id = 0;
    double w, x, y, z, tx, ty, tz;
    std::string name;
    EXPECT_EQ(images[i].find(" -0 "), std::string::npos) << images[i];
    ASSERT_TRUE(head >> id >> w >> x >> y >> z >> tx >> ty >> tz >> camera_id >> name) << images[i];
    EXPECT_TRUE(fs::exists(folder / "colmap" / "images" / name));
    EXPECT_TRUE(fs::exists(folder / "colmap" / "masks" / (name + ".png")));
    const Eigen::Quaterniond rotation(w, x, y, z);
    double u = 0, v = 0;
    std::string point;
    for (int f = 0; features >> u >> v >> point; ++f) {
      if (point == "-1") continue;
      ASSERT_TRUE(points.contains(point));
      seen[point].insert({id, f});
      const Eigen::Vector3d p = rotation * points[point] + Eigen::Vector3d(tx, ty, tz);
      errors.push_back(std::hypot(fx * p.x() / p.z() + cx - u, fy * p.y() / p.z() + cy - v));
    }
  }
  EXPECT_EQ(seen, tracks) << "both files tell the same tracks";
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 1.0) << "[px]";
  EXPECT_LT(errors[errors.size() * 95 / 100], 4.0) << "[px]";
}

TEST_F(Export, NerfstudiosPosesAreTheKeyframesWithTheAxesOfOpengl) {
  ASSERT_EQ(export_map("nerfstudio", {"--images", sequence().string()}).exit_code, 0);
  const std::string text = read_text(folder / "nerfstudio" / "transforms.json");
  EXPECT_FALSE(std::regex_search(text, std::regex("-0\\.0[,\\s]")));
  const auto model = nlohmann::json::parse(text);
  std::map<std::string, std::vector<double>> keyframes;
  for (const auto& row : rows_of(run.out / "keyframes.txt")) {
    for (int i = 1; i < 8; ++i) keyframes[row[0]].push_back(std::stod(row[static_cast<size_t>(i)]));
  }
  ASSERT_EQ(model["frames"].size(), keyframes.size());
  for (const auto& frame : model["frames"]) {
    const fs::path picture = frame["file_path"].get<std::string>();
    const auto& k = keyframes.at(picture.stem().string());
    const auto& m = frame["transform_matrix"];
    const Eigen::Vector3d forward = Eigen::Quaterniond(k[6], k[3], k[4], k[5]) * Eigen::Vector3d::UnitZ();
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(m[i][3].get<double>(), k[static_cast<size_t>(i)], 1e-6);
      EXPECT_NEAR(m[i][2].get<double>(), -forward[i], 1e-6) << "z looks backward";
    }
    EXPECT_EQ(read_picture(folder / "nerfstudio" / picture).grey.width(), 640);
    EXPECT_EQ(read_picture(folder / "nerfstudio" / frame["mask_path"].get<std::string>()).grey.height(), 480);
  }
}

TEST_F(Export, AModelHoldsNoPointsOfAMapThatIsNotJoined) {
  MapFile file = load_map(run.out / "map.dkb");
  const size_t points = file.map.point_count();
  file.map.append(Map(file.map));
  ASSERT_EQ(file.map.roots().size(), 2U);
  file.map.cull_keyframe(file.map.live_keyframes().at(1));  // so that the second is the larger one
  const size_t left_out = file.map.point_count() - points;
  ASSERT_LE(left_out, points);
  save_map(run.out / "map.dkb", file.map, file.context);
  for (const char* format : {"colmap", "nerfstudio"}) {
    const Finished done = export_map(format);
    ASSERT_EQ(done.exit_code, 0) << done.err;
    EXPECT_NE(done.out.find(", " + std::to_string(points) + " points;"), std::string::npos) << done.out;
    EXPECT_NE(done.out.find("; left out: 1 map that was never joined to it, with "), std::string::npos) << done.out;
  }
  EXPECT_EQ(lines_of(folder / "colmap" / "sparse" / "0" / "points3D.txt").size(), points);
  EXPECT_NE(read_text(folder / "nerfstudio" / "sparse_pc.ply").find("element vertex " + std::to_string(points) + "\n"),
            std::string::npos);
}

TEST_F(Export, CloudsAreOfTheMapThatTheTrajectoryIsOf) {
  MapFile file = load_map(run.out / "map.dkb");
  const size_t points = file.map.point_count();
  file.map.append(Map(file.map));
  save_map(run.out / "map.dkb", file.map, file.context);
  for (const char* format : {"ply", "pcd"}) {
    const Finished done = export_map(format);
    ASSERT_EQ(done.exit_code, 0) << done.err;
    EXPECT_NE(done.out.find(": " + std::to_string(points) + " points; left out: 1 map"), std::string::npos) << done.out;
  }
  EXPECT_NE(read_text(folder / "pcd").find("\nPOINTS " + std::to_string(points) + "\n"), std::string::npos);
  ASSERT_EQ(export_map("json").exit_code, 0);
  const auto json = nlohmann::json::parse(read_text(folder / "json"));
  EXPECT_EQ(json["points"].size(), 2 * points);
  EXPECT_EQ(json["points"].back()["map"], 1);
  const Finished recorded = run_program({"export", run.out.string(), "--out", (folder / "out.mcap").string()});
  ASSERT_EQ(recorded.exit_code, 0) << recorded.err;
  size_t bytes = 0;
  const auto stream = open_messages(folder / "out.mcap");
  while (const auto message = stream->next())
    if (stream->topics()[message->topic].name == "/map_points") bytes = message->bytes.size();
  EXPECT_GE(bytes, 16 * points);
  EXPECT_LT(bytes, 16 * points + 1000) << "with its header";
}

TEST_F(Export, AModelWithoutPicturesSaysSoAndAForeignRecordingIsRefused) {
  const Finished bare = export_map("nerfstudio");
  EXPECT_EQ(bare.exit_code, 0);
  EXPECT_NE(bare.out.find("no images"), std::string::npos) << bare.out;
  EXPECT_FALSE(
      nlohmann::json::parse(read_text(folder / "nerfstudio" / "transforms.json"))["frames"][0].contains("mask_path"));

  const TempFolder other;
  copy_sequence(other.path(), 5, false);
  std::string text = read_text(other / "associations.txt");
  for (size_t at = 0; (at = text.find("\n17", at)) != std::string::npos; at += 2) text.replace(at, 3, "\n18");
  if (text.starts_with("17")) text.replace(0, 2, "18");
  write_text(other / "associations.txt", text);
  const Finished foreign = export_map("colmap", {"--images", other.path().string()});
  EXPECT_EQ(foreign.exit_code, 2) << foreign.out;
  EXPECT_NE(foreign.err.find("keyframes; give the recording that the map was made from"), std::string::npos)
      << foreign.err;
}

TEST_F(Export, AModelListsOnlyTheKeyframesWhosePicturesWereWritten) {
  const TempFolder part;
  copy_sequence(part.path(), 5, false);
  const Finished nerfstudio = export_map("nerfstudio", {"--images", part.path().string(), "--detector", "none"});
  ASSERT_EQ(nerfstudio.exit_code, 0) << nerfstudio.err;
  EXPECT_NE(nerfstudio.err.find(" of the map's " + run.stats["keyframes"].dump() + " keyframes"), std::string::npos)
      << nerfstudio.err;
  const auto frames = nlohmann::json::parse(read_text(folder / "nerfstudio" / "transforms.json"))["frames"];
  ASSERT_GE(frames.size(), 1U);
  EXPECT_LT(frames.size(), run.stats["keyframes"].get<size_t>());
  for (const auto& frame : frames)
    EXPECT_TRUE(fs::exists(folder / "nerfstudio" / frame["file_path"].get<std::string>()));

  ASSERT_EQ(export_map("colmap", {"--images", part.path().string(), "--detector", "none"}).exit_code, 0);
  const fs::path sparse = folder / "colmap" / "sparse" / "0";
  const auto images = lines_of(sparse / "images.txt");
  ASSERT_EQ(images.size(), 2 * frames.size());
  std::set<std::string> ids;
  for (size_t i = 0; i < images.size(); i += 2) ids.insert(images[i].substr(0, images[i].find(' ')));
  for (const auto& row : rows_of(sparse / "points3D.txt")) {
    EXPECT_GT(row.size(), 8U) << "a point that no image sees";
    for (size_t i = 8; i + 1 < row.size(); i += 2) EXPECT_TRUE(ids.contains(row[i])) << row[i];
  }
}

TEST_F(Export, TheModelOfTheMasksMayStandInTheEnvironment) {
  const std::string map = (run.out / "map.dkb").string(), out = (folder / "model").string();
  const Finished done = run_program(
      {"map", "export", map, "--format", "colmap", "--out", out, "--images", sequence().string(), "--detector", "yolo"},
      -1, {"DKB_SLAM_MODEL=/nowhere/model.onnx"});
  EXPECT_EQ(done.exit_code, 2);
  EXPECT_NE(done.err.find("/nowhere/model.onnx"), std::string::npos) << done.err;
}

TEST_F(Export, OptionsThatDoNothingAreRefused) {
  const std::string images = sequence().string();
  const std::vector<std::pair<std::string, std::vector<std::string>>> maps = {
      {"ply", {"--images", images}},   {"ply", {"--camera", "fr1"}},     {"pcd", {"--detector", "motion"}},
      {"json", {"--model", "x.onnx"}}, {"pcd", {"--classes", "person"}}, {"colmap", {"--inference", "opencv"}}};
  for (const auto& [format, more] : maps) {
    const Finished done = export_map(format, more);
    EXPECT_EQ(done.exit_code, 2) << more[0];
    EXPECT_NE(done.err.find("error: " + more[0] + ": "), std::string::npos) << done.err;
  }
  EXPECT_NE(
      export_map("colmap", {"--images", images, "--detector", "motion", "--classes", "person"}).err.find("--classes: "),
      std::string::npos);
  const std::string tum = (folder / "tum").string(), bag = (folder / "x.bag").string();
  const std::vector<std::vector<std::string>> results = {{"--images", images, "--format", "tum", "--out", tum},
                                                         {"--camera", "fr1", "--format", "tum", "--out", tum},
                                                         {"--camera", "fr1", "--out", bag},
                                                         {"--depth-topic", "/d", "--out", bag}};
  for (const auto& more : results) {
    std::vector<std::string> arguments = {"export", run.out.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished done = run_program(arguments);
    EXPECT_EQ(done.exit_code, 2) << more[0];
    EXPECT_NE(done.err.find("error: " + more[0] + ": "), std::string::npos) << done.err;
  }
}

TEST_F(Export, TrajectoriesHaveARowForEachPose) {
  const size_t poses = rows_of(run.out / "trajectory.txt").size();
  for (const char* format : {"tum", "kitti", "euroc"}) {
    const fs::path file = folder / format;
    const Finished done = run_program({"export", run.out.string(), "--format", format, "--out", file.string()});
    ASSERT_EQ(done.exit_code, 0) << done.err;
    EXPECT_EQ(lines_of(file).size(), poses) << format;
  }
  EXPECT_EQ(read_text(folder / "tum"), read_text(run.out / "trajectory.txt"));
  EXPECT_EQ(run_program({"export", run.out.string(), "--out", (folder / "x.txt").string()}).exit_code, 2);
}

TEST_F(Export, ResultsBecomeARecordingWithPosesCloudAndPictures) {
  const fs::path file = folder / "results.mcap";
  const Finished done =
      run_program({"export", run.out.string(), "--out", file.string(), "--images", sequence().string()});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto stream = open_messages(file);
  std::map<std::string, int> counts;
  int64_t last = 0;
  size_t transforms = 0;
  while (const auto message = stream->next()) {
    const RecordedTopic& topic = stream->topics()[message->topic];
    ++counts[topic.name];
    EXPECT_GE(message->recorded_ns, last) << topic.name;
    last = message->recorded_ns;
    if (topic.name == "/tf") transforms += decode_transforms(message->bytes, topic.encoding).size();
    if (topic.name == "/features_image/compressed") {
      const auto image = decode_compressed_image(message->bytes, topic.encoding);
      EXPECT_EQ(decode_picture(image.data, "picture").grey.width(), 640);
    }
  }
  const int poses = run.stats["tracked"];
  EXPECT_EQ(transforms, static_cast<size_t>(poses));
  EXPECT_EQ(counts["/pose"], poses);
  EXPECT_EQ(counts["/features_image/compressed"], kSequenceFrames);
  EXPECT_EQ(counts["/map_points"], 1);
  EXPECT_EQ(counts["/path"], 1);
}

TEST_F(Export, TheLibraryWritesTheBytesOfTheProgram) {
  const auto source = open_folder(sequence());
  Slam slam(source->camera(), Options(), Detectors::none());
  std::vector<std::string> stamps;
  for (SourceFrame next = source->next(); next.state == SourceState::frame; next = source->next()) {
    slam.process(next.frame);
    stamps.push_back(next.stamp);
  }
  slam.finish();
  const fs::path tum = folder / "tum";
  save_trajectory(tum, slam.trajectory(), 0, TrajectoryFormat::tum, stamps);
  EXPECT_EQ(read_text(tum), read_text(run.out / "trajectory.txt"));
  save_trajectory(tum, slam.trajectory());
  EXPECT_EQ(read_text(tum), read_text(run.out / "trajectory.txt")) << "its stamps have six decimals";
  save_trajectory(tum, slam.keyframes());
  EXPECT_EQ(read_text(tum), read_text(run.out / "keyframes.txt"));
}

// It has no stamps: its first eight numbers would be taken for a row.
TEST_F(Export, KittisFilesAreNoTrajectories) {
  const std::string kitti = (folder / "kitti").string(), tum = (folder / "tum").string();
  ASSERT_EQ(run_program({"export", run.out.string(), "--format", "kitti", "--out", kitti}).exit_code, 0);
  const Finished done = run_program({"export", kitti, "--format", "tum", "--out", tum});
  EXPECT_EQ(done.exit_code, 2);
  EXPECT_NE(done.err.find("kitti:1: 12 numbers a row, as in a KITTI file: it has no stamps"), std::string::npos)
      << done.err;
  EXPECT_FALSE(fs::exists(tum));
}

TEST_F(Export, AnEmptyTrajectoryIsRefused) {
  write_text(folder / "empty.txt", "# nothing\n");
  const Finished done =
      run_program({"export", (folder / "empty.txt").string(), "--format", "tum", "--out", (folder / "tum").string()});
  EXPECT_EQ(done.exit_code, 2);
  EXPECT_NE(done.err.find("holds no pose"), std::string::npos) << done.err;
  EXPECT_FALSE(fs::exists(folder / "tum"));
}

TEST_F(Export, PicturesAreThoseOfTheRunAlsoAfterItsLastPose) {
  copy_sequence(folder / "other", 12, false);
  std::string later;
  for (const auto& row : rows_of(folder / "other/associations.txt"))
    later += "16" + row[0].substr(2) + " " + row[1] + " 16" + row[2].substr(2) + " " + row[3] + "\n";
  write_text(folder / "other/associations.txt", later);
  const fs::path file = folder / "results.mcap";
  const auto with_pictures = [&](const fs::path& source) {
    return run_program({"export", run.out.string(), "--out", file.string(), "--images", source.string()});
  };
  const Finished foreign = with_pictures(folder / "other");
  EXPECT_EQ(foreign.exit_code, 2);
  EXPECT_NE(foreign.err.find("--images: no picture has the stamp of a pose"), std::string::npos) << foreign.err;
  EXPECT_FALSE(fs::exists(file));

  std::string first_ten;
  for (const auto& row : rows_of(run.out / "trajectory.txt")) {
    if (std::count(first_ten.begin(), first_ten.end(), '\n') == 10) break;
    for (const std::string& word : row) first_ten += word + " ";
    first_ten += "\n";
  }
  write_text(run.out / "trajectory.txt", first_ten);
  const Finished done = with_pictures(sequence());
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto stream = open_messages(file);
  int pictures = 0;
  while (const auto message = stream->next())
    pictures += stream->topics()[message->topic].name == "/features_image/compressed";
  EXPECT_EQ(pictures, kSequenceFrames);
}

}  // namespace
}  // namespace dkb::test
