// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/trajectory_error.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_data.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;
using Pairs = std::vector<std::pair<size_t, size_t>>;

constexpr double kDegree = std::numbers::pi / 180.0;

StampedPose pose(double t, const Eigen::Vector3d& position, const Eigen::Vector3d& rotation_vector = {0, 0, 0}) {
  return {t, "", Rigid3(rotation_from_vector(rotation_vector), position)};
}

Trajectory stamps(const std::vector<double>& times) {
  Trajectory t;
  for (const double time : times) t.push_back(pose(time, {time, 0, 0}));
  return t;
}

Trajectory random_walk(int n, uint64_t seed) {
  Random random(seed);
  Trajectory t;
  Eigen::Vector3d position(1, 2, 3), rotation(0, 0, 0);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) position[k] += 0.1 * random.normal(), rotation[k] += 0.1 * random.normal();
    t.push_back(pose(100 + 0.1 * i, position, rotation));
  }
  return t;
}

TEST(Evaluate, APathOnALineOrInOnePlaceTellsNoRotationError) {
  // Its own copy: any turn about the line aligns it, so no figure may depend on which was taken.
  const auto line = [](const Eigen::Vector3d& step, double wiggle) {
    Trajectory t;
    for (int i = 0; i < 31; ++i) t.push_back(pose(0.1 * i, i * step + Eigen::Vector3d(0, 0, i % 2 == 0 ? wiggle : 0)));
    return t;
  };
  for (const Eigen::Vector3d& step : {Eigen::Vector3d(0.1, 0.05, 0.02), Eigen::Vector3d(0, 0, 0)}) {
    const Evaluation e = evaluate(line(step, 0), line(step, 0));
    EXPECT_FALSE(e.rotation_determined());
    EXPECT_EQ(e.ape.rotation.count, 0u);
    EXPECT_EQ(e.ape.translation.count, 31u);
    EXPECT_EQ(e.rpe.rotation.count, 30u) << "relative errors need no alignment";
    EXPECT_LT(e.ape.translation.max, 1e-9);
  }
  Trajectory far = line({0, 0, 1}, 0);
  for (StampedPose& p : far) p.world_from_cam.translation.x() = 1e17;
  EXPECT_FALSE(evaluate(far, far).rotation_determined());
  // A walk of 3 m that sways by a centimetre, and one that sways less than files round.
  EXPECT_TRUE(evaluate(line({0.1, 0, 0}, 0.01), line({0.1, 0, 0}, 0.01)).rotation_determined());
  EXPECT_FALSE(evaluate(line({0.1, 0, 0}, 1e-5), line({0.1, 0, 0}, 1e-5)).rotation_determined());
  EXPECT_FALSE(evaluate(line({0.1, 0, 0}, 0.01), line({0.1, 0, 0}, 0)).rotation_determined());
}

TEST(Evaluate, EachAlignmentLeavesWhatItDoesNotTakeAway) {
  // The truth goes 4 m along x and 2 m along y. The estimate is 3 m off in z from the start, half as long, and turned
  // by a right angle about z at its first pose alone.
  Trajectory truth, estimate;
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(4, 0, 0), Eigen::Vector3d(4, 2, 0)}) {
    const double t = static_cast<double>(truth.size());
    truth.push_back(pose(t, at));
    estimate.push_back(pose(t, 0.5 * at + Eigen::Vector3d(0, 0, 3), {0, 0, t == 0 ? 90 * kDegree : 0}));
  }
  const auto errors = [&](Alignment alignment) {
    return evaluate(truth, estimate, {.rpe_delta = {}, .alignment = alignment}).ape;
  };

  // Not aligned: (0, 0, 3), (-2, 0, 3) and (-2, -1, 3); the first rotation alone is off.
  const PoseErrors none = errors(Alignment::none);
  EXPECT_NEAR(none.translation_m[0], 3, 1e-12);
  EXPECT_NEAR(none.translation_m[1], std::sqrt(13), 1e-12);
  EXPECT_NEAR(none.translation_m[2], std::sqrt(14), 1e-12);
  EXPECT_NEAR(none.rotation_deg[0], 90, 1e-9);
  EXPECT_NEAR(none.rotation_deg[1], 0, 1e-9);

  // By the first pose, all is turned by -90 degrees about z: (0, 0, 0), (0, -2, 0), (1, -2, 0).
  const PoseErrors origin = errors(Alignment::origin);
  EXPECT_NEAR(origin.translation_m[0], 0, 1e-12);
  EXPECT_NEAR(origin.translation_m[1], std::sqrt(16 + 4), 1e-12);
  EXPECT_NEAR(origin.translation_m[2], std::sqrt(9 + 16), 1e-12);
  EXPECT_NEAR(origin.rotation_deg[0], 0, 1e-9);
  EXPECT_NEAR(origin.rotation_deg[1], 90, 1e-9);

  // By all positions: half of what each is from the mean (8/3, 2/3, 0) is missing, 1/2 sqrt(64 + 4) / 3 of the first;
  // with a scale of 2 nothing is.
  EXPECT_NEAR(errors(Alignment::se3).translation_m[0], std::sqrt(68.0) / 6, 1e-9);
  EXPECT_NEAR(errors(Alignment::sim3).translation.max, 0, 1e-9);
  EXPECT_NEAR(evaluate(truth, estimate, {.rpe_delta = {}, .alignment = Alignment::sim3}).truth_from_estimate.scale, 2,
              1e-9);
}

TEST(Evaluate, WithoutAlignmentAPathOnALineTellsItsRotationError) {
  const Evaluation e = evaluate(stamps({0, 1, 2}), stamps({0, 1, 2}), {.rpe_delta = {}, .alignment = Alignment::none});
  EXPECT_TRUE(e.rotation_determined());
  EXPECT_EQ(e.ape.rotation.count, 3u);
}

TEST(Evaluate, AlignmentsHaveEvosNames) {
  for (const char* name : {"se3", "sim3", "origin", "none"}) EXPECT_STREQ(name_of(alignment_named(name, "")), name);
  EXPECT_THROW(alignment_named("SE3", "--align"), InputError);
}

TEST(ReadPoses, NamesTheTrajectoryInAFolder) {
  const fs::path folder = fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_read_poses");
  fs::create_directories(folder);
  const auto message = [&] {
    try {
      read_poses(folder);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(message(),
            folder.string() + ": is a folder; give the trajectory in it, as " + (folder / "trajectory.txt").string());
  std::ofstream(folder / "groundtruth.txt") << "\n";
  EXPECT_NE(message().find((folder / "groundtruth.txt").string()), std::string::npos);
  fs::remove_all(folder);
}

TEST(ErrorStatistics, AreThoseOfThePopulation) {
  // 1 2 3 6: mean 3, squares 1 + 4 + 9 + 36 = 50, deviations 4 + 1 + 0 + 9 = 14.
  const ErrorStatistics s = error_statistics({3, 1, 6, 2});
  EXPECT_EQ(s.mean, 3);
  EXPECT_EQ(s.rmse, std::sqrt(12.5));
  EXPECT_EQ(s.std, std::sqrt(3.5));
  EXPECT_EQ(s.median, 2.5);
  EXPECT_EQ(s.min, 1);
  EXPECT_EQ(s.max, 6);
  EXPECT_EQ(error_statistics({5, 1, 3}).median, 3);
  EXPECT_EQ(error_statistics({}).count, 0u);
}

TEST(MatchStamps, WalksTheShorterAndMayTakeAPoseTwice) {
  EXPECT_EQ(match_stamps(stamps({1.00, 1.01}), stamps({0.99, 1.002, 1.5}), 0.02), (Pairs{{0, 1}, {1, 1}}));
  EXPECT_EQ(match_stamps(stamps({0.99, 1.002, 1.5}), stamps({1.00, 1.01}), 0.02), (Pairs{{1, 0}, {1, 1}}));
  EXPECT_EQ(match_stamps(stamps({1.0, 1.01}), stamps({1.005, 3}), 0.02), (Pairs{{0, 0}}))
      << "equally long: the second is walked";
  EXPECT_EQ(match_stamps(stamps({1.0}), stamps({1.25, 1.5}), 0.25).size(), 1u) << "the limit itself is in";
  EXPECT_TRUE(match_stamps(stamps({}), stamps({1.0}), 0.02).empty());
}

TEST(MatchStamps, TakesTheFirstOfEqualStampsAndOfEqualDistances) {
  EXPECT_EQ(match_stamps(stamps({1.0}), stamps({0.5, 1.5, 2.0}), 1), (Pairs{{0, 0}}));
  EXPECT_EQ(match_stamps(stamps({1.0}), stamps({0.25, 0.75, 0.75, 0.75, 2.0}), 1), (Pairs{{0, 1}}));
  EXPECT_EQ(match_stamps(stamps({1.0}), stamps({0.0, 1.125, 1.125}), 1), (Pairs{{0, 1}}));
}

TEST(MatchStamps, EqualsTheExhaustiveSearch) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> a, b;
    for (int i = 0; i < 30; ++i) a.push_back(0.01 * random.below(200));
    for (int i = 0; i < 60; ++i) b.push_back(0.01 * random.below(200));
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    Pairs expected;
    for (size_t i = 0; i < a.size(); ++i) {
      size_t best = 0;
      for (size_t j = 1; j < b.size(); ++j)
        if (std::abs(b[j] - a[i]) < std::abs(b[best] - a[i])) best = j;
      if (std::abs(b[best] - a[i]) <= 0.02) expected.emplace_back(i, best);
    }
    EXPECT_EQ(match_stamps(stamps(a), stamps(b), 0.02), expected);
  }
}

TEST(Evaluate, AMovedCopyHasNoError) {
  const Trajectory truth = random_walk(200, 1);
  const Rigid3 motion(rotation_from_vector({1, -2, 0.5}), {5, 6, 7});
  Trajectory estimate = truth;
  for (StampedPose& p : estimate) p.world_from_cam = motion * p.world_from_cam;
  const Evaluation e = evaluate(truth, estimate);
  EXPECT_LT(e.ape.translation.max, 1e-12);
  EXPECT_LT(e.ape.rotation.max, 1e-10);
  EXPECT_LT(e.rpe.translation.max, 1e-12);
  EXPECT_LT(e.rpe.rotation.max, 1e-10);
  EXPECT_EQ(e.timestamps.size(), 200u);
}

TEST(Evaluate, ScaleIsTakenOutOnlyWhenAsked) {
  const Trajectory truth = random_walk(100, 2);
  Trajectory estimate = truth;
  for (StampedPose& p : estimate) p.world_from_cam.translation *= 0.5;
  EXPECT_GT(evaluate(truth, estimate).ape.translation.rmse, 0.1);
  const Evaluation e = evaluate(truth, estimate, {.rpe_delta = {}, .alignment = Alignment::sim3});
  EXPECT_NEAR(e.truth_from_estimate.scale, 2.0, 1e-12);
  EXPECT_LT(e.ape.translation.max, 1e-12);
  EXPECT_LT(e.rpe.translation.max, 1e-12);
}

TEST(Evaluate, HandComputedErrors) {
  // A square in the xy plane; the estimate's corners stand 0.1 m above and below it in turn, so that the best alignment
  // is none, and its cameras are turned by 10 degrees about z.
  Trajectory truth, estimate;
  const Eigen::Vector3d corners[] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  for (int i = 0; i < 4; ++i) {
    truth.push_back(pose(i, corners[i]));
    estimate.push_back(pose(i, corners[i] + Eigen::Vector3d(0, 0, i % 2 == 0 ? 0.1 : -0.1), {0, 0, 10 * kDegree}));
  }
  const Evaluation e = evaluate(truth, estimate);
  EXPECT_NEAR(e.ape.translation.rmse, 0.1, 1e-12);
  EXPECT_NEAR(e.ape.translation.min, 0.1, 1e-12);
  EXPECT_NEAR(e.ape.rotation.rmse, 10, 1e-9);
  EXPECT_NEAR(e.ape.rotation.max, 10, 1e-9);
  // A step (1, 0, 0) is seen as (cos 10, -sin 10, +-0.2) by cameras that are turned: the error is
  // sqrt((1 - cos 10)^2 + sin^2 10 + 0.04) = sqrt(2 - 2 cos 10 + 0.04) for each of the three steps.
  EXPECT_EQ(e.rpe.translation.count, 3u);
  EXPECT_NEAR(e.rpe.translation.rmse, std::sqrt(2 - 2 * std::cos(10 * kDegree) + 0.04), 1e-12);
  EXPECT_NEAR(e.rpe.rotation.max, 0, 1e-9);
}

TEST(Evaluate, RelativeErrorsAreOverStretchesThatDoNotOverlap) {
  // Steps of 0.25 m every 0.1 s.
  Trajectory t;
  for (int i = 0; i < 10; ++i) t.push_back(pose(1305031102.1 + 0.1 * i, {0.25 * i, 0.0, 0}));
  const auto pairs = [&](const char* delta) { return evaluate(t, t, {.rpe_delta = parse_rpe_delta(delta)}).rpe_pairs; };
  EXPECT_EQ(pairs("1f").size(), 9u);
  EXPECT_EQ(pairs("4f"), (Pairs{{0, 4}, {4, 8}}));
  EXPECT_EQ(pairs("0.3s"), (Pairs{{0, 3}, {3, 6}, {6, 9}}));
  // The path of the aligned estimate is the first to reach 0.6 m at pose 3, and again three poses later.
  EXPECT_EQ(pairs("0.6m"), (Pairs{{3, 6}, {6, 9}}));
  EXPECT_TRUE(pairs("100m").empty());
  EXPECT_EQ(evaluate(t, t, {.rpe_delta = parse_rpe_delta("100f")}).rpe.translation.count, 0u);
}

TEST(Evaluate, AllPairsBeginAtEveryPose) {
  Trajectory t;
  for (int i = 0; i < 10; ++i) t.push_back(pose(1305031102.1 + 0.1 * i, {0.25 * i, 0.0, 0}));
  const auto pairs = [&](const char* delta) {
    return evaluate(t, t, {.rpe_delta = parse_rpe_delta(delta), .rpe_all_pairs = true}).rpe_pairs;
  };
  EXPECT_EQ(pairs("1f").size(), 9u);
  EXPECT_EQ(pairs("7f"), (Pairs{{0, 7}, {1, 8}, {2, 9}}));
  EXPECT_EQ(pairs("0.72s"), (Pairs{{0, 7}, {1, 8}, {2, 9}})) << "the nearest within a tenth";
  EXPECT_EQ(pairs("1.8m"), (Pairs{{0, 7}, {1, 8}, {2, 9}}));
  EXPECT_TRUE(pairs("0.15s").empty()) << "0.1 s and 0.2 s are farther than a tenth away";
  EXPECT_TRUE(pairs("100m").empty());
  // A gap: no pair reaches over it that is much longer than asked for.
  t.erase(t.begin() + 3, t.begin() + 7);
  EXPECT_EQ(pairs("0.2s"), (Pairs{{0, 2}, {3, 5}}));
}

TEST(Evaluate, AnOffsetIsAddedToTheEstimatesStamps) {
  const Trajectory truth = random_walk(50, 4);
  Trajectory estimate = truth;
  for (StampedPose& p : estimate) p.timestamp -= 1000.25;
  EXPECT_THROW(evaluate(truth, estimate), InputError);
  const Evaluation e = evaluate(truth, estimate, {.time_offset = 1000.25, .rpe_delta = {}});
  EXPECT_EQ(e.timestamps.size(), 50u);
  EXPECT_NEAR(e.timestamps[0], truth[0].timestamp, 1e-9);
  EXPECT_LT(e.ape.translation.max, 1e-9);
  EXPECT_THROW(evaluate(truth, truth, {.time_offset = std::nan(""), .rpe_delta = {}}), InvalidOption);
}

// A walk whose errors are `sd` [m] and independent.
Trajectory disturbed(Trajectory t, double sd) {
  Random random(9);
  for (StampedPose& p : t)
    for (int k = 0; k < 3; ++k) p.world_from_cam.translation[k] += sd * random.normal();
  return t;
}

TEST(Evaluate, AScaleThatIsWrongBeyondDoubtIsTold) {
  const Trajectory truth = random_walk(200, 5);
  const auto scaled = [&](double factor, double sd) {
    Trajectory t = truth;
    for (StampedPose& p : t) p.world_from_cam.translation *= factor;
    return disturbed(t, sd);
  };
  ASSERT_TRUE(evaluate(truth, scaled(0.2, 0.01)).wrong_scale);
  EXPECT_NEAR(*evaluate(truth, scaled(0.2, 0.01)).wrong_scale, 5, 0.1);
  EXPECT_NEAR(evaluate(truth, scaled(1000, 1)).wrong_scale.value_or(0), 0.001, 1e-5);
  EXPECT_FALSE(evaluate(truth, scaled(1.05, 0.01)).wrong_scale) << "a focal length may be off by so much";
  EXPECT_FALSE(evaluate(truth, scaled(1, 0.3)).wrong_scale);
  EXPECT_FALSE(evaluate(truth, scaled(0.2, 0.01), {.rpe_delta = {}, .alignment = Alignment::sim3}).wrong_scale);
  // One that has nothing in common with the truth has no scale: it fits best when it is shrunk.
  EXPECT_FALSE(evaluate(truth, random_walk(200, 6)).wrong_scale);
}

// A camera that begins to move at 0.3 m/s; its estimate is off by `error` of the way so far, as when the error wanders.
Trajectory beginning(int poses, double error) {
  Random random(4);
  Trajectory t;
  Eigen::Vector3d off(0, 0, 0);
  for (int i = 0; i < poses; ++i) {
    const double s = i / 30.0;
    t.push_back(pose(s, Eigen::Vector3d(0.3 * s, 0.1 * s * s, 0) + off));
    for (int k = 0; k < 3; ++k) off[k] += error * 0.01 * random.normal();
  }
  return t;
}

TEST(Evaluate, AFewPosesTellNoScale) {
  for (const int poses : {2, 3, 4, 5, 10, 30})
    for (const double error : {0.1, 0.3, 1.0, 3.0})
      EXPECT_FALSE(evaluate(beginning(poses, 0), beginning(poses, error)).wrong_scale) << poses << " " << error;
}

// Errors of a few millimetres that go with each other, on a way of a metre: a wrong depth factor stands out.
TEST(Evaluate, AScaleIsToldAlsoWhereErrorsHangTogether) {
  for (const double factor : {0.2, 5.0}) {
    Trajectory estimate = beginning(100, 0.1);
    for (StampedPose& p : estimate) p.world_from_cam.translation *= factor;
    EXPECT_NEAR(evaluate(beginning(100, 0), estimate).wrong_scale.value_or(0) * factor, 1, 0.05) << factor;
  }
}

TEST(Evaluate, TellsHowWellPositionsTellTheRotation) {
  // A clip of a second that moves by 4 mm, with errors of 5 mm and cameras turned by 2 degrees about z.
  Trajectory clip, turned;
  for (int i = 0; i < 30; ++i) {
    const double a = 0.2 * i;
    clip.push_back(pose(0.03 * i, {0.004 * std::cos(a), 0.004 * std::sin(a), 0}));
    turned.push_back(pose(0.03 * i, clip.back().world_from_cam.translation, {0, 0, 2 * kDegree}));
  }
  EXPECT_NEAR(evaluate(clip, turned).ape.rotation.rmse, 2, 1e-9) << "without errors of position it is told";
  const Evaluation e = evaluate(clip, disturbed(turned, 0.005));
  EXPECT_EQ(e.ape.rotation.count, 30u);
  // 5 mm a coordinate, over 30 poses, on a lever of 2.8 mm.
  EXPECT_NEAR(e.rotation_sd_deg, 0.005 / std::sqrt(30) / 0.0028 / kDegree, 8);
  // The same errors on a walk of some metres.
  EXPECT_TRUE(evaluate(random_walk(200, 5), disturbed(random_walk(200, 5), 0.005)).rotation_sd_deg < 0.1);
}

TEST(Evaluate, TooFewMatchesAreAnInputError) {
  EXPECT_THROW(evaluate(stamps({1, 2, 3}), stamps({11, 12})), InputError);
  EXPECT_EQ(test::input_error_of([] {
              evaluate(stamps({1, 2, 3}), stamps({}), {}, "run");
            }),
            "run: the estimate has no poses; was every frame lost?");
  EXPECT_EQ(test::input_error_of([] { evaluate(stamps({}), stamps({1, 2})); }), "the truth has no poses");
  EXPECT_THROW(evaluate(stamps({1}), stamps({1})), InputError);
  EXPECT_THROW(evaluate(stamps({1, 2}), stamps({1, 2}), {.max_difference = -1, .rpe_delta = {}}), InvalidOption);
  EXPECT_EQ(evaluate(stamps({1, 2}), stamps({1, 2})).ape.translation.count, 2u);
}

TEST(RpeDelta, IsANumberWithItsUnit) {
  EXPECT_EQ(parse_rpe_delta("3f").unit, DeltaUnit::frames);
  EXPECT_EQ(parse_rpe_delta("0.5m").value, 0.5);
  EXPECT_EQ(parse_rpe_delta("2s").unit, DeltaUnit::seconds);
  EXPECT_EQ(to_string(parse_rpe_delta("0.50m")), "0.5m");
  for (const char* bad : {"", "f", "1", "1x", "-1f", "0m", "1.5f", "nanm", "infs", "1 f"})
    EXPECT_THROW(parse_rpe_delta(bad), InputError) << bad;
}

TEST(Evaluate, AgreesWithTheReferenceOnARecordedTrajectory) {
  const fs::path folder = test_data() / "trajectories";
  if (!fs::exists(folder)) GTEST_SKIP() << "skipped: no recorded trajectories at hand";
  const Evaluation e =
      evaluate(read_trajectory(folder / "fr2_desk_groundtruth.txt"), read_trajectory(folder / "fr2_desk_ORB.txt"));
  // Figures of an independent implementation (numpy) that agrees with evo.
  EXPECT_EQ(e.ape.translation_m.size(), 2225u);
  const auto agree = [](const ErrorStatistics& s, double rmse, double mean, double median, double std, double min,
                        double max) {
    EXPECT_NEAR(s.rmse, rmse, 1e-9);
    EXPECT_NEAR(s.mean, mean, 1e-9);
    EXPECT_NEAR(s.median, median, 1e-9);
    EXPECT_NEAR(s.std, std, 1e-9);
    EXPECT_NEAR(s.min, min, 1e-9);
    EXPECT_NEAR(s.max, max, 1e-9);
  };
  agree(e.ape.translation, 0.008145956633364333, 0.007516934202181128, 0.007436574711424516, 0.003138838905189613,
        0.0003377329022689524, 0.024337839618062147);
  agree(e.ape.rotation, 0.9936337330112127, 0.9634514379694341, 0.952077986132852, 0.2430418113255973,
        0.13396601079003995, 2.023574490832703);
  agree(e.rpe.translation, 0.0035975930748651094, 0.003099502096405833, 0.0027861987150971986, 0.0018264070429926725,
        0.00013196900558809174, 0.021168736300526982);
  agree(e.rpe.rotation, 0.2866180875522621, 0.23407711422621247, 0.19066131963621424, 0.16540203356562722,
        0.006038945781812774, 1.2594035027088464);
}

}  // namespace
}  // namespace dkb
