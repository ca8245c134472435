// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>

#include "dkb/dataset/movers_file.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

struct MoverEvaluationOptions {
  double match_distance = 0.5;    // [m] an estimated mover belongs to the nearest true one within, > 0
  double same_stamp = 0.002;      // [s] stamps this near are one frame, >= 0
  double max_distance = 4.0;      // [m] true movers farther from the camera are left out of the position error, > 0
  double max_hidden = 1.0;        // [s] crossings that hide a mover for longer are not counted, > 0
  double before_and_after = 0.5;  // [s] a mover's id is looked for so long before and after a crossing, > 0
  void check() const;             // throws InvalidOption
};

struct MoverEvaluation {
  size_t true_movers = 0;            // rows of the truth within the distance
  size_t found = 0;                  // of these, matched by an estimate
  size_t false_movers = 0;           // estimates that belong to no true mover
  double median_position_error = 0;  // [m] of the matched; 0 when there are none
  double median_velocity_error = 0;  // [m/s]
  double share_within_two_sd = 0;    // of the matched, coordinates within 2 position_sd of the truth
  double mean_velocity_nees = 0;     // squared velocity error over 3 velocity_sd^2: 1 where that tells the truth
  size_t crossings = 0;              // one for each mover of a pair that passed each other in the image
  size_t kept = 0;                   // of these, followed under the same id before and after
  size_t ids = 0;                    // different ids that were given to true movers
  double kept_share() const { return crossings > 0 ? static_cast<double>(kept) / static_cast<double>(crossings) : 1.0; }
};

// Estimated movers against the true ones of the same frames. In each frame pairs are made by increasing distance, each
// mover in one at most. A crossing: the boxes of two true movers meet (or one vanishes behind the other) and come apart
// again in the opposite order from left to right; a mover counts when it had an id just before. `truth_from_world` maps
// the estimate's world to the truth's. `camera_in_truth` gives the camera's place [m] in the truth's world at a time
// [s]; an empty function: no mover is too far away. Deterministic.
MoverEvaluation evaluate_movers(const MoverRows& truth, const MoverRows& estimate, const Rigid3& truth_from_world,
                                const std::function<Eigen::Vector3d(double)>& camera_in_truth,
                                const MoverEvaluationOptions& options = {});

}  // namespace dkb
