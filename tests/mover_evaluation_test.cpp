// SPDX-License-Identifier: Apache-2.0
#include "mover_evaluation.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

MoverRow row(double time, int id, const Eigen::Vector3d& position, float box_x = 0) {
  MoverRow r{time, std::to_string(time), {}};
  r.mover = {id, "person", position, {0, 0, 0}, 0.05, Matrix6d::Zero(), {0, 0, 0}, {box_x, 0, 60, 100}};
  return r;
}

// Two movers pass each other in the image: 1 goes right, 2 left; they share columns in frames 3 ... 5.
MoverRows crossing_truth() {
  MoverRows rows;
  for (int i = 0; i < 9; ++i) {
    rows.push_back(row(0.1 * i, 1, {0.1 * i, 0, 2}, static_cast<float>(20 * i)));
    rows.push_back(row(0.1 * i, 2, {0.8 - 0.1 * i, 0, 4}, static_cast<float>(160 - 20 * i)));
  }
  return rows;
}

TEST(MoverEvaluation, ErrorsAreMediansOfMatchedMovers) {
  const MoverRows truth = {row(0, 1, {0, 0, 2}), row(1, 1, {0, 0, 2}), row(2, 1, {0, 0, 2}), row(3, 1, {0, 0, 2})};
  const MoverRows estimate = {row(0, 5, {0.09, 0, 2}), row(1, 5, {0.03, 0, 2}), row(2, 5, {0, 0.2, 2}),
                              row(3, 5, {0, 0, 3})};
  const MoverEvaluation result = evaluate_movers(truth, estimate, Rigid3(), {});
  EXPECT_EQ(result.true_movers, 4u);
  EXPECT_EQ(result.found, 3u);  // the last is a metre off
  EXPECT_EQ(result.false_movers, 1u);
  EXPECT_NEAR(result.median_position_error, 0.09, 1e-12);
  EXPECT_EQ(result.ids, 1u);
  EXPECT_NEAR(result.share_within_two_sd, 8.0 / 9.0, 1e-12);  // all coordinates but the 0.2
}

TEST(MoverEvaluation, VelocitiesAreHeldAgainstTheirStandardDeviation) {
  MoverRows estimate = {row(0, 5, {0, 0, 2}), row(1, 5, {0, 0, 2})};
  for (MoverRow& r : estimate) r.mover.covariance.bottomRightCorner<3, 3>() = 0.25 * Eigen::Matrix3d::Identity();
  estimate[0].mover.velocity_in_world = {1, 0, 0.5};  // 1.25 / (3 * 0.25)
  estimate[1].mover.velocity_in_world = {0, 0.5, 0};  // 0.25 / (3 * 0.25)
  const MoverEvaluation result = evaluate_movers({row(0, 1, {0, 0, 2}), row(1, 1, {0, 0, 2})}, estimate, Rigid3(), {});
  EXPECT_NEAR(result.mean_velocity_nees, (5.0 / 3 + 1.0 / 3) / 2, 1e-12);
}

TEST(MoverEvaluation, TheAlignmentIsApplied) {
  const Rigid3 truth_from_world(Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  const MoverRows truth = {row(0, 1, truth_from_world * Eigen::Vector3d(4, 5, 6))}, estimate = {row(0, 1, {4, 5, 6})};
  EXPECT_EQ(evaluate_movers(truth, estimate, Rigid3(), {}).found, 0u);
  EXPECT_NEAR(evaluate_movers(truth, estimate, truth_from_world, {}).median_position_error, 0, 1e-12);
}

TEST(MoverEvaluation, FarMoversAreLeftOut) {
  const MoverRows truth = {row(0, 1, {0, 0, 2}), row(0, 2, {0, 0, 6})};
  const auto camera = [](double) { return Eigen::Vector3d(0, 0, 0); };
  EXPECT_EQ(evaluate_movers(truth, truth, Rigid3(), camera).true_movers, 1u);
  EXPECT_EQ(evaluate_movers(truth, truth, Rigid3(), {}).true_movers, 2u);
}

TEST(MoverEvaluation, EachEstimateBelongsToOneMover) {
  const MoverRows truth = {row(0, 1, {0, 0, 2}), row(0, 2, {0.2, 0, 2})}, estimate = {row(0, 1, {0.05, 0, 2})};
  EXPECT_EQ(evaluate_movers(truth, estimate, Rigid3(), {}).found, 1u);
}

TEST(MoverEvaluation, ACrossingCountsOncePerMover) {
  const MoverEvaluation result = evaluate_movers(crossing_truth(), crossing_truth(), Rigid3(), {});
  EXPECT_EQ(result.crossings, 2u);
  EXPECT_EQ(result.kept, 2u);
  EXPECT_EQ(result.kept_share(), 1.0);
}

TEST(MoverEvaluation, SwappedAndNewIdsAreNotKept) {
  MoverRows swapped = crossing_truth(), renewed = crossing_truth();
  for (size_t i = 10; i < swapped.size(); ++i) swapped[i].mover.id = 3 - swapped[i].mover.id;
  EXPECT_EQ(evaluate_movers(crossing_truth(), swapped, Rigid3(), {}).kept, 0u);
  for (size_t i = 10; i < renewed.size(); ++i)
    if (renewed[i].mover.id == 2) renewed[i].mover.id = 9;
  EXPECT_EQ(evaluate_movers(crossing_truth(), renewed, Rigid3(), {}).kept, 1u);
}

TEST(MoverEvaluation, MovingApartAgainOnTheSameSideIsNoCrossing) {
  MoverRows truth = crossing_truth();
  for (size_t i = 10; i < truth.size(); ++i) truth[i].mover.box.x = 160 - truth[i].mover.box.x;
  EXPECT_EQ(evaluate_movers(truth, truth, Rigid3(), {}).crossings, 0u);
}

TEST(MoverEvaluation, HiddenMoversCrossTooUnlessTheyStayAwayForLong) {
  MoverRows truth = crossing_truth();
  std::erase_if(truth, [](const MoverRow& r) { return r.mover.id == 2 && r.timestamp > 0.35 && r.timestamp < 0.45; });
  EXPECT_EQ(evaluate_movers(truth, truth, Rigid3(), {}).crossings, 2u);
  MoverEvaluationOptions strict;
  strict.max_hidden = 0.05;
  EXPECT_EQ(evaluate_movers(truth, truth, Rigid3(), {}, strict).crossings, 0u);
}

TEST(MoverEvaluation, MoversLostInTheCrossingAreNotKept) {
  MoverRows lost = crossing_truth();
  std::erase_if(lost, [](const MoverRow& r) { return r.mover.id == 2 && r.timestamp > 0.25; });
  const MoverEvaluation result = evaluate_movers(crossing_truth(), lost, Rigid3(), {});
  EXPECT_EQ(result.crossings, 2u);
  EXPECT_EQ(result.kept, 1u);
}

TEST(MoverEvaluation, NothingIsNoError) {
  const MoverEvaluation result = evaluate_movers({}, {}, Rigid3(), {});
  EXPECT_EQ(result.found, 0u);
  EXPECT_EQ(result.median_position_error, 0);
  EXPECT_THROW(evaluate_movers({}, {}, Rigid3(), {}, {.match_distance = 0}), InvalidOption);
}

}  // namespace
}  // namespace dkb
