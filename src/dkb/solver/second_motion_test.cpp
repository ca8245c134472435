// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/second_motion.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "dkb/util/random.h"

namespace dkb {
namespace {

struct SceneOptions {
  int room = 150, body = 90;                   // points
  Eigen::Vector3d moved = {0.012, -0.004, 0};  // [m] the body
  double wrong = 0;                            // share of matches that show something else
  uint64_t seed = 1;
};

// A camera moves a little before a room 0.8 to 1.6 m away and somebody who stands half a metre away.
struct BodyInRoom {
  CameraModel camera;
  Rigid3 cam_from_world{rotation_from_vector({0.01, -0.02, 0.005}), {0.02, -0.01, 0.005}};
  std::vector<PoseObservation> observations;
  std::vector<uint8_t> of_body;

  explicit BodyInRoom(const SceneOptions& options) {
    Random random(options.seed);
    const auto see = [&](const Eigen::Vector3d& point, const Eigen::Vector3d& moved) {
      const Eigen::Vector3d q = cam_from_world * Eigen::Vector3d(point + moved);
      PoseObservation o;
      o.point_in_world = point;
      o.pixel_sigma = 1.2;
      o.pixel = camera.project(q) + Eigen::Vector2d{random.normal(), random.normal()};
      if (random.uniform() < 0.7) {
        o.depth_sigma = 0.003 * q.z() * q.z() + 0.001;
        o.depth = q.z() + 0.6 * o.depth_sigma * random.normal();
      }
      if (random.uniform() < options.wrong)
        o.pixel += Eigen::Vector2d{random.uniform(-40, 40), random.uniform(-40, 40)};
      observations.push_back(o);
    };
    for (int i = 0; i < options.room; ++i) {
      const double z = random.uniform(0.8, 1.6);
      see({random.uniform(-0.55, 0.55) * z, random.uniform(-0.4, 0.4) * z, z}, Eigen::Vector3d::Zero());
    }
    for (int i = 0; i < options.body; ++i)
      see({random.uniform(-0.15, 0.1), random.uniform(-0.2, 0.2), random.uniform(0.45, 0.55)}, options.moved);
    of_body.assign(static_cast<size_t>(options.room), 0);
    of_body.resize(observations.size(), 1);
  }

  PoseEstimate estimate(const std::vector<uint8_t>* moves = nullptr) const {
    std::vector<PoseObservation> still;
    for (size_t i = 0; i < observations.size(); ++i)
      if (moves == nullptr || !(*moves)[i]) still.push_back(observations[i]);
    return optimise_pose(camera, cam_from_world, still);
  }
  double error(const PoseEstimate& pose) const {
    return (centre_in_world(pose.cam_from_world) - centre_in_world(cam_from_world)).norm();
  }
  std::optional<std::vector<uint8_t>> look(const PosePrior* expected = nullptr) const {
    auto second = second_motion(camera, estimate().cam_from_world, observations, 20, expected);
    if (!second) return std::nullopt;
    return std::move(second->moves);
  }
  // Shares of the room's and of the body's matches that are said to move.
  std::pair<double, double> moving(const std::vector<uint8_t>& moves) const {
    std::array<double, 2> count{}, said{};
    for (size_t i = 0; i < moves.size(); ++i) ++count[of_body[i]], said[of_body[i]] += moves[i];
    return {said[0] / count[0], said[1] / count[1]};
  }
};

TEST(SecondMotion, IsThatOfSomebodyWhoTakesThePoseAlong) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const BodyInRoom scene({.seed = seed});
    const PoseEstimate between = scene.estimate();
    EXPECT_GT(between.inliers, 0.7 * static_cast<double>(scene.observations.size())) << "no gate would tell";
    const auto moves = scene.look();
    ASSERT_TRUE(moves) << seed;
    const auto [room, body] = scene.moving(*moves);
    EXPECT_LT(room, 0.05) << seed;
    EXPECT_GT(body, 0.9) << seed;
    EXPECT_GT(scene.error(between), 0.004) << seed;
    EXPECT_LT(scene.error(scene.estimate(&*moves)), 0.003) << seed;
  }
}

TEST(SecondMotion, IsSureOnceItIsMoreThanParametersSave) {
  const auto count = [](double millimetres) {
    std::pair<int, int> found_and_sure;
    for (uint64_t seed = 1; seed <= 40; ++seed) {
      const BodyInRoom scene({.moved = {0.001 * millimetres, 0, 0}, .seed = seed});
      const auto second = second_motion(scene.camera, scene.estimate().cam_from_world, scene.observations, 20);
      found_and_sure.first += second.has_value();
      found_and_sure.second += second && second->sure;
    }
    return found_and_sure;
  };
  EXPECT_EQ(count(5).second, 0);
  EXPECT_GT(count(6).first, count(6).second);
  EXPECT_EQ(count(9), std::make_pair(40, 40));
}

TEST(SecondMotion, IsNotSeenWhereEverythingStands) {
  for (uint64_t seed = 1; seed <= 100; ++seed)
    EXPECT_FALSE(BodyInRoom({.moved = {0, 0, 0}, .seed = seed}).look()) << seed;
}

TEST(SecondMotion, IsNotMadeOfWrongMatches) {
  for (uint64_t seed = 1; seed <= 100; ++seed)
    EXPECT_FALSE(BodyInRoom({.moved = {0, 0, 0}, .wrong = 0.2, .seed = seed}).look()) << seed;
}

TEST(SecondMotion, IsFoundAmongWrongMatches) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const BodyInRoom scene({.wrong = 0.15, .seed = seed});
    const auto moves = scene.look();
    ASSERT_TRUE(moves) << seed;
    EXPECT_LT(scene.error(scene.estimate(&*moves)), 0.003) << seed;
  }
}

TEST(SecondMotion, IsThatOfTheNearerOneWhereMostMatchesAreOnHim) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const BodyInRoom scene({.room = 80, .body = 130, .moved = {0.02, 0, 0}, .seed = seed});
    const auto moves = scene.look();
    ASSERT_TRUE(moves) << seed;
    EXPECT_LT(scene.moving(*moves).first, 0.1) << seed;
    EXPECT_GT(scene.moving(*moves).second, 0.9) << seed;
  }
}

// Who has taken the camera along altogether leaves no match with the room that a pose near his could be wrong about.
TEST(SecondMotion, IsSoughtFromAnotherPoseAsWell) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Eigen::Vector3d moved{0.05, 0, 0};
    const BodyInRoom scene({.moved = moved, .seed = seed});
    const Rigid3 along = scene.cam_from_world * Rigid3(Eigen::Quaterniond::Identity(), moved);
    EXPECT_FALSE(second_motion(scene.camera, along, scene.observations, 20)) << seed;
    const auto second = second_motion(scene.camera, along, scene.observations, 20, nullptr, &scene.cam_from_world);
    ASSERT_TRUE(second) << seed;
    const auto [room, body] = scene.moving(second->moves);
    EXPECT_LT(room, 0.05) << seed;
    EXPECT_GT(body, 0.9) << seed;
    EXPECT_LT((centre_in_world(second->cam_from_world) - centre_in_world(scene.cam_from_world)).norm(), 0.005) << seed;
  }
}

TEST(SecondMotion, IsWorthAskingForWhereNearAndFarDiffer) {
  int asked = 0;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    const auto differ = [&](const BodyInRoom& scene) {
      return near_and_far_differ(scene.camera, scene.estimate().cam_from_world, scene.observations);
    };
    EXPECT_TRUE(differ(BodyInRoom({.seed = seed}))) << seed;
    asked += differ(BodyInRoom({.moved = {0, 0, 0}, .wrong = 0.2, .seed = seed}));
  }
  EXPECT_LT(asked, 30);
  EXPECT_FALSE(near_and_far_differ(BodyInRoom({}).camera, {}, {}));
}

// Down a corridor most points of the room are beyond the sensor's range, and how far the map takes them for is a guess.
TEST(SecondMotion, IsNotToldByPointsWithoutDepth) {
  BodyInRoom scene({});
  for (size_t i = 0; i < scene.observations.size(); ++i)
    if (!scene.of_body[i] && i % 10 != 0) scene.observations[i].depth = 0;
  EXPECT_FALSE(scene.look());
}

// What is expected of the camera to `sd` [m, rad].
PosePrior expectation(const Rigid3& cam_from_world, double sd) {
  return {cam_from_world, Matrix6d::Identity() / (sd * sd)};
}

TEST(SecondMotion, ThatIsFaintIsNotBelievedOfACameraThatCannotHaveMovedLikeThat) {
  int alone = 0, as_it_is = 0, along_with_him = 0;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    const BodyInRoom scene({.body = 60, .moved = {0.005, -0.002, 0}, .seed = seed});
    const PosePrior of_camera = expectation(scene.cam_from_world, 0.0005);
    const PosePrior of_both = expectation(scene.estimate().cam_from_world, 0.0001);
    alone += scene.look().has_value();
    as_it_is += scene.look(&of_camera).has_value();
    along_with_him += scene.look(&of_both).has_value();
  }
  EXPECT_GT(alone, 80);
  EXPECT_GE(as_it_is, alone - 2);
  EXPECT_LT(along_with_him, 10);
}

// Whoever has taken the camera along for some frames has made its velocity as well.
TEST(SecondMotion, ThatIsPlainIsBelievedThoughItIsNotExpected) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const BodyInRoom scene({.seed = seed});
    const PosePrior along_with_him = expectation(scene.estimate().cam_from_world, 0.00001);
    EXPECT_TRUE(scene.look(&along_with_him)) << seed;
  }
}

TEST(SecondMotion, SaysHowMuchTheExpectationWeighs) {
  const BodyInRoom scene({});
  const Rigid3 between = scene.estimate().cam_from_world;
  const auto weight = [&](const PosePrior* expected) {
    return second_motion(scene.camera, between, scene.observations, 20, expected).value().expected_weight;
  };
  const PosePrior right = expectation(scene.cam_from_world, 0.01), wrong = expectation(between, 0.00001);
  EXPECT_GT(weight(&right), 1.0);  // 10 / (4 + d^2)
  EXPECT_LT(weight(&wrong), 0.01);
  EXPECT_EQ(weight(nullptr), 0.0);
}

TEST(SecondMotion, LeavesEnoughForThePose) {
  const BodyInRoom scene({});
  const Rigid3 pose = scene.estimate().cam_from_world;
  EXPECT_TRUE(second_motion(scene.camera, pose, scene.observations, 20));
  EXPECT_FALSE(second_motion(scene.camera, pose, scene.observations, 200));
  EXPECT_FALSE(second_motion(scene.camera, pose, {}, 0));
}

}  // namespace
}  // namespace dkb
