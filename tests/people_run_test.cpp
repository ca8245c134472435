// SPDX-License-Identifier: Apache-2.0
// People through the whole program, by every kind of detector: poses, features and map against the simulator's truth.
//
// What right wiring measures on this sequence (six seeds, each with one pair less at the start), and what wrong wiring
// does (one seed, the first row six). Limits lie between, nearer to the right ones.
//                                            APE [mm]    leak           lost        map points on people
//   motion, boxes, masks, motion with boxes   5 ... 7    .000 ... .006  .06 ... .09    0 ... 4
//   networks, answers after 3 or 4 frames     5 ... 6    .017 ... .050  .07 ... .09    0 ... 8
//   every 12th frame, answer after 8          8 ... 9    .050 ... .090  .07 ... .09    0 ... 10
//   no filter                                39 ... 50   .34 ... .36    .05 ... .09   67 ... 110
//   all of each box left out                  5          .001           .57            5
//   boxes 200 px beside the people           48          .26            .09           82
//   boxes of 15 frames before                 9          .10            .09
//   boxes with x and y swapped               25          .32            .09
//   boxes for one of two people              20          .22            .09
//   masks inverted (53 of 90 frames tracked) 287         .45           1.00          223
//   masks of the frame before                 5          .009           .10            0
//   masks of 5 frames before                  8          .058           .09           14
//   masks mirrored                           37          .26            .09
//   masks upside down                         8          .035           .17
#include <gtest/gtest.h>

#include <iostream>
#include <map>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/detection/onnx_network.h"
#include "e2e_support.h"
#include "mover_evaluation.h"
#include "people_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

// A run on the people, scored.
struct PeopleRun : SlamRun {
  PeopleRun(const fs::path& out_folder, Arguments arguments, const Arguments& more = {})
      : SlamRun(people_sequence(), out_folder, joined(std::move(arguments), more)) {
    if (finished.exit_code != 0) return;
    const fs::path data = people_sequence();
    ape = ape_of(data, out / "trajectory.txt");
    online_ape = ape_of(data, out / "trajectory_online.txt");
    features = feature_use(data, read_features(out / "features.csv"));
    const Rigid3 truth_from_run = truth_from_world(data, out / "trajectory_online.txt");
    map_points_on_people = points_on_people(data, read_cloud(out / "map.ply"), truth_from_run);
    movers = evaluate_movers(read_movers(data / "movers.csv"), read_movers(out / "movers.csv"), truth_from_run, {});
    std::cout << "APE " << ape << " m, online " << online_ape << " m, tracked " << stats.at("tracked") << " of "
              << stats.at("frames") << ", leak " << features.leak << " of " << features.on_people << ", lost "
              << features.lost << " of " << features.in_boxes << ", map points on people " << map_points_on_people
              << " of " << stats.at("map_points") << ", retracted " << stats.at("dynamic").at("points_retracted")
              << ", movers found " << movers.found << " of " << movers.true_movers << " within "
              << movers.median_position_error << " m, " << movers.false_movers << " false\n";
  }
  static Arguments joined(Arguments a, const Arguments& b) {
    a.push_back("--dump-features");
    a.insert(a.end(), b.begin(), b.end());
    return a;
  }
  double ape = 1e9, online_ape = 1e9;  // [m]
  FeatureUse features;
  int map_points_on_people = -1;
  MoverEvaluation movers;
};

// `leak`: largest share of the features on people that may be used; `ape` [m].
void expect_people_kept_out(const PeopleRun& run, double leak, double ape = 0.01) {
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.finished.err, "");
  EXPECT_EQ(run.stats.at("frames"), kPeopleFrames);
  EXPECT_EQ(run.stats.at("lost"), 0);
  EXPECT_EQ(run.stats.at("maps"), 1);
  EXPECT_LT(run.ape, ape) << "[m]";
  EXPECT_LT(run.online_ape, ape) << "[m]";
  EXPECT_GT(run.features.on_people, 4000);
  EXPECT_LT(run.features.leak, leak);
  EXPECT_GT(run.features.in_boxes, 4000);
  EXPECT_LT(run.features.lost, 0.2);
  EXPECT_LT(run.map_points_on_people, 20);
}

// In real time what is left out depends on the machine: accuracy is asked of a run that had the time, the rest always.
const char* const kTooBusy = "skipped: the machine was too busy for a run in real time";

void expect_all_accounted_for(const PeopleRun& run) {
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  const auto count = [&](const char* key) { return run.stats.at(key).get<int>(); };
  EXPECT_EQ(count("tracked") + count("lost") + count("skipped"), kPeopleFrames);
}
bool kept_pace(const PeopleRun& run) {
  return run.stats.at("skipped") <= 0.1 * kPeopleFrames;
}

// Detectors that answer in the frame they are asked about.
class People : public ::testing::TestWithParam<const char*> {
 protected:
  static void expect_kept_out(const PeopleRun& run) {
    expect_people_kept_out(run, std::string(GetParam()) == "masks" ? 0.003 : 0.015);
    EXPECT_GT(run.movers.found, 0.6 * static_cast<double>(run.movers.true_movers));
    EXPECT_LT(run.movers.false_movers, 0.1 * static_cast<double>(run.movers.true_movers));
    EXPECT_LT(run.movers.median_position_error, 0.06) << "[m]";
  }
  TempFolder temp;
};

TEST_P(People, StayOutOfPosesFeaturesAndMap) {
  const PeopleRun run(temp / "out", people_detector(GetParam()));
  expect_kept_out(run);
  EXPECT_EQ(run.stats.at("tracked"), kPeopleFrames);
}

TEST_P(People, StayOutInRealTime) {
  const PeopleRun run(temp / "out", people_detector(GetParam()), {"--realtime"});
  expect_all_accounted_for(run);
  if (!kept_pace(run)) GTEST_SKIP() << kTooBusy;
  expect_kept_out(run);
}

INSTANTIATE_TEST_SUITE_P(By, People, ::testing::Values("motion", "boxes", "masks", "motion_with_boxes"),
                         [](const auto& p) { return std::string(p.param); });

class PeopleInViewAtTheStart : public People {};

TEST_P(PeopleInViewAtTheStart, StayOutOfPosesFeaturesAndMap) {
  const PeopleRun run(temp / "out", people_detector(GetParam()), {"--start", "1.2"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), run.stats.at("frames"));
  EXPECT_LT(run.ape, 0.01) << "[m]; 0.044 without a filter";
  EXPECT_LT(run.features.leak, 0.005) << "0.30 without a filter";
  EXPECT_LT(run.map_points_on_people, 20);
}

INSTANTIATE_TEST_SUITE_P(By, PeopleInViewAtTheStart, ::testing::Values("masks"),
                         [](const auto& p) { return std::string(p.param); });

TEST(PeopleByMotionAndBoxes, AreFoundByEither) {
  const TempFolder temp;
  std::string boxes_of_one;
  for (const MoverRow& row : read_movers(people_sequence() / "movers.csv")) {
    const Box& b = row.mover.box;
    if (row.mover.id != 1) continue;
    boxes_of_one += row.stamp + " person";
    for (const float v : {b.x, b.y, b.w, b.h}) boxes_of_one += " " + std::to_string(v);
    boxes_of_one += "\n";
  }
  write_text(temp / "boxes.txt", boxes_of_one);
  const PeopleRun run(temp / "out", {"--detector", "motion+file", "--boxes", temp / "boxes.txt"});
  expect_people_kept_out(run, 0.015);  // by these boxes alone 0.22
  std::map<std::string, int> movers;
  for (const MoverRow& row : read_movers(run.out / "movers.csv")) ++movers[row.mover.class_name];
  EXPECT_GT(movers["person"], 20) << "as the boxes say";
  EXPECT_GT(movers["object"], 20) << "that is all that motion knows";
}

// A network answers some frames later: boxes are carried, masks come late, points are retracted.
class PeopleByNetwork : public ::testing::Test {
 protected:
  TempFolder temp;
};

class PeopleByAnyNetwork : public PeopleByNetwork, public ::testing::WithParamInterface<const char*> {};

TEST_P(PeopleByAnyNetwork, StayOutOfPosesFeaturesAndMap) {
  const Arguments detector = people_detector(GetParam());
  if (detector.empty()) GTEST_SKIP() << no_people_detector(GetParam());
  const PeopleRun run(temp / "out", detector);
  expect_people_kept_out(run, 0.1);
  EXPECT_EQ(run.stats.at("tracked"), kPeopleFrames);
  EXPECT_EQ(run.stats.at("detector").at("kind"), "yolo");
}

INSTANTIATE_TEST_SUITE_P(Named, PeopleByAnyNetwork,
                         ::testing::Values("yolov5n_320x256", "yolov5n_320x256_by_opencv", "yolox_nano"),
                         [](const auto& p) { return std::string(p.param); });

// Which of both computes it is the user's choice, and what that costs in latency is known beforehand.
TEST_F(PeopleByNetwork, IsComputedByWhatWasNamed) {
  const Arguments detector = people_detector("yolov5n_320x256");
  if (detector.empty()) GTEST_SKIP() << no_people_detector("yolov5n_320x256");
  for (const auto& [name, latency] : std::map<std::string, int>{{"onnxruntime", 1}, {"opencv", 3}}) {
    if (!available(inference_named(name))) continue;
    const SlamRun run(people_sequence(), temp / name,
                      PeopleRun::joined(detector, {"--inference", name, "--max-frames", "10"}));
    ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
    EXPECT_EQ(run.stats.at("detector").at("inference"), name);
    EXPECT_EQ(run.stats.at("detector").at("latency_frames"), latency);
  }
  const SlamRun missing(people_sequence(), temp / "missing",
                        PeopleRun::joined(detector, {"--inference", "onnxruntime"}),
                        {"DKB_ONNXRUNTIME=/no/such/library.so"});
  EXPECT_EQ(missing.finished.exit_code, 2);
  EXPECT_EQ(missing.finished.error_lines(), 1u) << missing.finished.err;
  for (const char* said : {"/no/such/library.so", "make onnxruntime", "DKB_ONNXRUNTIME"})
    EXPECT_NE(missing.finished.err.find(said), std::string::npos) << missing.finished.err;
}

// Every twelfth frame, known eight frames later: whoever came in meanwhile is in the map until the answer is there.
TEST_F(PeopleByNetwork, AreRetractedWhenTheAnswerIsLate) {
  const Arguments detector = people_detector("yolov5n_320x256");
  if (detector.empty()) GTEST_SKIP() << no_people_detector("yolov5n_320x256");
  const PeopleRun run(temp / "out", detector, {"--detect-every", "12", "--detect-latency", "8"});
  expect_people_kept_out(run, 0.15, 0.012);  // until the answer they take part
  EXPECT_GT(run.stats.at("dynamic").at("points_retracted"), 50);
}

// Later answers come eight frames after their image; the first is used at once.
TEST_F(PeopleByNetwork, AreKeptOutFromTheFirstFrameOn) {
  const Arguments detector = people_detector("yolov5n_320x256");
  if (detector.empty()) GTEST_SKIP() << no_people_detector("yolov5n_320x256");
  for (const std::string pace : {"--threads=1", "--realtime"}) {
    const SlamRun run(people_sequence(), temp / pace,
                      PeopleRun::joined(detector, {pace, "--start", "0.7", "--max-frames", "4", "--detect-every", "12",
                                                   "--detect-latency", "8"}));
    ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
    const FeatureUse features = feature_use(people_sequence(), read_features(run.out / "features.csv"), 0);
    EXPECT_GT(features.on_people, 100);
    EXPECT_LT(features.leak, 0.2) << pace << "; 0.37 when nobody waits";
  }
}

TEST_F(PeopleByNetwork, AndByMotionStayOutBetweenAnswers) {
  const Arguments detector = people_detector("yolov5n_320x256_with_motion");
  if (detector.empty()) GTEST_SKIP() << no_people_detector("yolov5n_320x256");
  const PeopleRun run(temp / "out", detector, {"--detect-every", "12", "--detect-latency", "8"});
  expect_people_kept_out(run, 0.015);
}

TEST_F(PeopleByNetwork, StayOutInRealTime) {
  const Arguments detector = people_detector("yolov5n_320x256");
  if (detector.empty()) GTEST_SKIP() << no_people_detector("yolov5n_320x256");
  const PeopleRun run(temp / "out", detector, {"--realtime"});
  expect_all_accounted_for(run);
  // Ten answers a second are wanted, as many as the sequence at rest gets.
  if (!kept_pace(run) || run.stats.at("detector").at("rate_hz") < 9) GTEST_SKIP() << kTooBusy;
  expect_people_kept_out(run, 0.1);
}

// What the tests above could not tell from right wiring would make them worthless.
TEST(PeopleControl, WithoutAFilterTheyBendPosesAndMap) {
  const TempFolder temp;
  // Delays that were learnt among people would take up some of their pull.
  const std::string stamped = "timing.estimate=false";
  const PeopleRun run(temp / "out", people_detector("nothing"), {"--set", stamped});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_GT(run.ape, 0.02) << "[m]; twice what a filter may leave";
  EXPECT_GT(run.online_ape, 0.02);
  EXPECT_GT(run.features.leak, 0.2);
  EXPECT_GE(run.map_points_on_people, 40) << "twice what a filter may leave";
  EXPECT_EQ(run.movers.found, 0U);
  const PeopleRun off(temp / "off", people_detector("boxes"), {"--filter", "none", "--set", stamped});
  EXPECT_EQ(read_text(off.out / "features.csv"), read_text(run.out / "features.csv")) << "boxes nobody asked for";
}

TEST(PeopleControl, BoxesBesideThePeopleAreNoticed) {
  const TempFolder temp;
  std::string beside;
  for (const auto& row : rows_of(people_sequence() / "boxes.txt")) {
    const int x = std::stoi(row[2]) + 200, w = std::min(std::stoi(row[4]), 640 - x);
    if (w > 0)
      beside += row[0] + " person " + std::to_string(x) + " " + row[3] + " " + std::to_string(w) + " " + row[5] + "\n";
  }
  write_text(temp / "boxes.txt", beside);
  const PeopleRun run(temp / "out", {"--detector", "file", "--boxes", temp / "boxes.txt"});
  // The pose may be right all the same: matches that show a second motion are left out.
  EXPECT_GT(run.features.leak, 0.15);
  const PeopleRun right(temp / "right", people_detector("boxes"));
  EXPECT_GT(run.map_points_on_people, right.map_points_on_people + 10);
  // What takes boxes at their word, and looks at nothing else, lets them in as if there were no filter.
  const PeopleRun blind(temp / "blind", {"--detector", "file", "--boxes", temp / "boxes.txt"}, {"--filter", "box"});
  EXPECT_GT(blind.online_ape, 0.02) << "[m]; twice what a filter may leave";
  EXPECT_GT(blind.features.leak, 0.2);
  EXPECT_GE(blind.map_points_on_people, 40) << "twice what a filter may leave";
}

TEST(PeopleControl, MasksOfEarlierFramesAreNoticed) {
  const TempFolder temp;
  const auto rows = rows_of(people_sequence() / "rgb.txt");
  for (const size_t before : {1U, 5U}) {
    const fs::path masks = temp / ("masks" + std::to_string(before));
    fs::create_directory(masks);
    for (size_t i = before; i < rows.size(); ++i)
      fs::create_symlink(people_sequence() / "masks" / (rows[i - before][0] + ".png"), masks / (rows[i][0] + ".png"));
    const PeopleRun run(temp / ("out" + std::to_string(before)), {"--masks", masks});
    EXPECT_GT(run.features.leak, before == 1 ? 0.003 : 0.03) << before;
  }
}

TEST(PeopleControl, InvertedMasksAreNoticed) {
  const TempFolder temp;
  const fs::path masks = temp / "masks";
  fs::create_directory(masks);
  for (const auto& row : rows_of(people_sequence() / "rgb.txt")) {
    GreyImage mask = read_picture(people_sequence() / "masks" / (row[0] + ".png")).grey;
    for (size_t i = 0; i < mask.size(); ++i) mask.data()[i] = static_cast<uint8_t>(255 - mask.data()[i]);
    write_text(masks / (row[0] + ".png"), encode_png(mask, 1));
  }
  const PeopleRun run(temp / "out", {"--masks", masks});
  EXPECT_LT(run.stats.at("tracked"), 75);
  EXPECT_GT(run.features.lost, 0.9);
}

}  // namespace
}  // namespace dkb::test
