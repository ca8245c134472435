// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "dkb/geometry/rigid3.h"

namespace dkb::test {

// The scene of people.yaml: 90 simulated frames at 640 x 480 in TUM layout, the same for all tests. Nobody is in the
// first ones. boxes.txt, masks/ and movers.csv are the truth about the people. Made on demand.
constexpr int kPeopleFrames = 90;
std::filesystem::path people_sequence();

// What `run` needs to find these people: "nothing", "motion", "boxes", "masks", "motion_with_boxes", or the name of a
// network among the outside data's models, alone or followed by "_with_motion" and "_by_opencv". Empty when that is not
// at hand.
std::vector<std::string> people_detector(const std::string& name);
std::string no_people_detector(const std::string& network);

// What features.csv says, by stamp.
struct FeatureRow {
  float x = 0, y = 0;  // [px]
  std::string state;
};
using FeatureRows = std::map<std::string, std::vector<FeatureRow>>;
FeatureRows read_features(const std::filesystem::path& csv);

// Which features a run used, by the true masks and boxes. Corners within 2 px of the rim of a silhouette inside, and 10
// px outside, count for neither side; nor do the first `skipped` frames.
struct FeatureUse {
  int on_people = 0;  // features on people
  double leak = 0;    // share of these that was used
  int in_boxes = 0;   // features of the background inside people's boxes
  double lost = 0;    // 1 - used share of these / used share of the background outside; 1 when that is hardly used
};
FeatureUse feature_use(const std::filesystem::path& dataset, const FeatureRows& features, int skipped = 10);

// [m] points of map.ply, in the run's world.
std::vector<Eigen::Vector3d> read_cloud(const std::filesystem::path& ply);

// From the run's world, that of its first tracked camera, to the ground truth's; by that camera's true pose.
Rigid3 truth_from_world(const std::filesystem::path& dataset, const std::filesystem::path& online_trajectory);

// Map points that lie where in any frame the surface of a person was: within 2 cm + 2% of the depth measured on its
// mask, 15 px from the rim (colour and depth are up to 16 ms apart). The still world never lies there.
int points_on_people(const std::filesystem::path& dataset, const std::vector<Eigen::Vector3d>& points,
                     const Rigid3& truth_from_world);

}  // namespace dkb::test
