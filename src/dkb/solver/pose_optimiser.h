// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

// Variance of errors in the plane, in units of the one that they were divided by, told by the median of their squares,
// which the tails hardly move. 20 errors of variance 1 stand beside those at hand. Reorders `squares`, at least one.
double variance_by_median(std::span<double> squares);
// Errors have tails that a Gaussian has not: of lines of text, the match in the row beside fits within the limit, and
// such matches take a pose along that little else holds. Their weights are those of Student's t with four degrees of
// freedom (Lange, Little and Taylor, JASA 1989), in a pose about a scale that its own observations tell.
inline constexpr double kStudentFreedom = 4;
inline double student_weight(double squared_error, double times = 1) {
  return times * (kStudentFreedom + 2) / (kStudentFreedom + squared_error);
}
// Of the squares of errors in the plane by Student's t with four degrees of freedom, nine of ten are below so many
// times that variance: twice the quantile of F(2, 4).
inline constexpr double kStudent90 = 8.65;
inline constexpr double kDepthInFront = 0.01;  // [m] points nearer than this along the optical axis are outliers

// One match of a known point with a feature of the image whose pose is sought.
struct PoseObservation {
  Eigen::Vector3d point_in_world;  // [m]
  Eigen::Vector2d pixel;           // [px] ideal (undistorted)
  double pixel_sigma = 1.0;        // [px] > 0, standard deviation of each coordinate
  double depth = 0.0;              // [m] along the optical axis; 0 = none
  double depth_sigma = 0.01;       // [m] > 0 where depth is given
  double weight = 1.0;             // > 0, of what the sigmas say; one that counts less may also be off by more
};

struct PoseOptions {
  int tail_rounds =
      3;  // of weights by how well an observation fits, and a step, >= 0; without, all inliers weigh alike
  int min_inliers = 6;  // fewer at the end: not ok, >= 3

  void check() const;  // throws InvalidOption
};

// Gaussian knowledge of the pose from elsewhere (motion model): world_from_cam = prior.world_from_cam * T(d), with
// d = [translation m, rotation rad] in camera axes, normal with zero mean and this information (inverse covariance).
struct PosePrior {
  Rigid3 cam_from_world;
  Matrix6d information = Matrix6d::Zero();
};

struct PoseEstimate {
  bool ok = false;        // enough inliers, a well-conditioned system, finite numbers
  Rigid3 cam_from_world;  // the initial pose where not ok
  // Of the right perturbation of world_from_cam, [translation m, rotation rad], camera axes, from the inliers (and the
  // prior) with the sigmas as given. Zero where not ok.
  Matrix6d covariance = Matrix6d::Zero();
  // Where a prior stands beside the observations, what they say alone; nothing if they leave a direction open.
  std::optional<PosePrior> by_observations;
  std::vector<uint8_t> inlier;  // per observation
  int inliers = 0;
};

// Pose that minimises sum rho(e^T Sigma^-1 e), e = [reprojection px, depth m], by Levenberg-Marquardt on 6 numbers;
// observations are classified anew after each round, all of them, so that an outlier may come back, until a round
// changes no classification. Then what fits is weighed by how well it does by its own sigmas: rho is Student's t about
// the scale at hand.
// Deterministic; never throws but for options out of range.
PoseEstimate optimise_pose(const CameraModel& camera, const Rigid3& cam_from_world_initial,
                           std::span<const PoseObservation> observations, const PoseOptions& options = {},
                           const PosePrior* prior = nullptr);

}  // namespace dkb
