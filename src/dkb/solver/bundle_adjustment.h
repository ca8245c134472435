// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/solver/pose_edges.h"
#include "dkb/util/chi_square.h"

namespace dkb {

struct BaObservation {
  int camera = 0;                // index into BaProblem::cam_from_world
  int point = 0;                 // index into BaProblem::points
  double u = 0, v = 0;           // [px] ideal (undistorted)
  double inv_sigma = 1.0;        // [1/px] > 0, of each coordinate
  double depth = 0.0;            // [m] along the optical axis; 0 = none
  double inv_depth_sigma = 0.0;  // [1/m] > 0 where depth is given
  double weight = 1.0;           // w of DKB eq. 48, > 0, on the reprojection part; depth has weight 1
};

struct BaProblem {
  CameraModel camera;  // pinhole part only; observations are undistorted
  std::vector<Rigid3> cam_from_world;
  std::vector<uint8_t> fixed;               // per camera: 1 = stays where it is. Fix one at least.
  std::vector<Eigen::Vector3d> points;      // [m] in the world
  std::vector<BaObservation> observations;  // any order; of one (camera, point) pair there may be several
  std::vector<PoseEdge> motions;            // between cameras, by what is not in the observations
  int asked = -1;                           // a free camera whose covariance is wanted; -1 = none
};

struct BaOptions {
  std::vector<int> rounds = {5, 10};    // Levenberg-Marquardt iterations of each round, >= 1; outliers are told apart
                                        // after each round and left out of the next
  bool prefilter = false;               // leave out observations beyond the limits before the first round (DKB 3.3)
  double chi2_pixel = kChi2TwoDof95;    // outlier limit and Huber corner of the unweighted error without depth, > 0
  double chi2_depth = kChi2ThreeDof95;  // the same with depth, > 0
  double initial_damping = 1e-5;        // Marquardt's factor on the diagonal at the start, > 0
  double relative_tolerance = 1e-5;     // a step that lowers the cost by less than this part ends the round, >= 0

  // For poses and motions alone, a pose graph: it starts far from where it ends, and there is nothing to tell apart.
  static BaOptions of_pose_graph() {
    BaOptions options;
    options.rounds = {20};
    options.initial_damping = options.relative_tolerance = 1e-6;
    return options;
  }
  void check() const;  // throws InvalidOption
};

struct BaResult {
  std::vector<uint8_t> outlier;  // per observation, at the end, all judged anew
  double initial_cost = 0,
         final_cost = 0;  // sum of w rho(e^T Sigma^-1 e) of the first round's start and the last one's end
  int iterations = 0;     // accepted and rejected steps of all rounds
  // Of the camera that was asked for, where the fixed cameras are known exactly: the inverse of the normal equations at
  // the end, times how much farther apart the parts of its image pull than they claim (Liang and Zeger, "Longitudinal
  // data analysis using generalized linear models", 1986). Right perturbation of world_from_cam, [translation m,
  // rotation rad]; null where the observations leave it open.
  std::optional<Matrix6d> covariance;
};

// Bundle adjustment (DKB eqs. 42-48): refines the free cameras and all points of `problem` in place.
//
// Minimises sum w rho(e^T Sigma^-1 e) of the observations, and of the motions with w = 1, by Levenberg-Marquardt;
// points are eliminated (Schur complement), the cameras' system is solved by a block-sparse Cholesky factorisation, so
// local windows and whole maps take the same way. rho: Huber on the unweighted error. Where w differs from 1 and depth
// is present, the part min(w, 1) has one kernel over pixel and depth; what the heavier of the two has beyond that has a
// kernel of its own (kernels.inl). Points that the observations do not determine move only where they are determined,
// and points without a usable observation stay. Observations behind their camera are outliers. The result holds no NaN
// if the input holds none. Deterministic. Throws InputError for indices or sizes that do not fit.
BaResult bundle_adjust(BaProblem& problem, const BaOptions& options = {});

}  // namespace dkb
