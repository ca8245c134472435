// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb::solver {

// The inner loops of pose optimisation, bundle adjustment and block Cholesky. Each exists for the baseline processor
// and for AVX2, from one source (kernels.inl) over groups of four numbers, so both give the same bits.
//
// Common terms. A pose moves by the right perturbation of world_from_cam, d = [translation, rotation] in camera axes:
// point_in_cam(d) = R(d_rot)^T (point_in_cam - d_trans), so d point_in_cam / d d = A = [-I, skew(point_in_cam)].
// With J = d residual / d point_in_cam and Omega the weights, everything derives from M = J^T Omega J and g = J^T Omega
// e:
//   pose: A^T M A and A^T g;   point: R^T M R and R^T g;   between them W = A^T M R.

// Pinhole camera and pose.
struct CameraPose {
  double fx, fy, cx, cy;  // [px]
  double rotation[9];     // of cam_from_world, row by row
  double translation[3];  // [m]
  double depth_in_front;  // [m] nearer points have no residual
};

// Observations of one camera as arrays; entries come in groups of four, filled up with entries of weight 0.
struct ObservationArrays {
  const double* u;
  const double* v;                // [px]
  const double* inv_sigma;        // [1/px]
  const double* depth;            // [m]
  const double* inv_depth_sigma;  // [1/m]; 0 = no depth
  const double* weight;           // 0 together with inv_depth_sigma 0 = left out
};

struct RobustLimits {
  bool robust;        // false: least squares
  double chi2_pixel;  // Huber corner without depth
  double chi2_depth;  // with depth
};

// Layout of the sums for a pose: the upper triangle of A^T M A row by row (21), then A^T g (6), then the cost.
inline constexpr int kPoseSums = 28;
inline constexpr int kPoseCost = 27;
// Of a point: upper triangle of R^T M R (6), R^T g (3), unused (3).
inline constexpr int kPointStride = 12;
// Of a (point, camera) pair: W column by column (18), unused (2).
inline constexpr int kPairStride = 20;
inline constexpr int kBlockSize = 36;

struct PoseInput {
  CameraPose camera;
  ObservationArrays observations;
  const double* x;
  const double* y;
  const double* z;  // [m] points in the world
  int count;        // multiple of 4
  RobustLimits limits;
};

struct BaCameraInput {
  CameraPose camera;
  ObservationArrays observations;
  const int* point;      // index of each observation's point
  const int* pair;       // index of each observation's (point, camera) pair; equal for repeated observations, adjacent
  const double* points;  // [m] x y z 0 of each point
  int begin, end;        // observations, multiples of 4
  RobustLimits limits;
};

struct SchurInput {
  int points;
  const int* pair_first;         // per point, points + 1 entries
  const int* pair_camera;        // per pair: free camera
  const int* block;              // per point: blocks of its camera pairs (a <= b), row by row
  const long long* block_first;  // per point
  const double* point_sums;
  const double* pair_sums;
  double damping;
};

struct SolverKernels {
  // Sums over all observations of one camera with known points.
  void (*pose_sums)(const PoseInput& input, double* sums);
  // chi2[i] of every observation, unweighted; infinity where the point is not in front of the camera.
  void (*pose_chi2)(const PoseInput& input, double* chi2);
  // Adds to the points' sums; writes the pairs' and the pose's sums. A fixed camera has only points and cost.
  void (*ba_linearise)(const BaCameraInput& input, bool fixed, double* point_sums, double* pair_sums,
                       double* pose_sums);
  // Cost alone; an observation whose point came to lie behind the camera costs kBehindCost.
  double (*ba_cost)(const BaCameraInput& input);
  void (*ba_chi2)(const BaCameraInput& input, double* chi2);
  // Eliminates the points: subtracts from the cameras' system (blocks of 36, gradient of 6 per camera), and writes per
  // point the Cholesky factor L of its damped block (l00 l10 l20 l11 l21 l22, the diagonal inverted) and L^-1 gradient;
  // l00 = 0 marks a point without information.
  void (*schur)(const SchurInput& input, double* blocks, double* gradient, double* factors);
  // c -= a b^T, 6x6 column by column.
  void (*subtract_abt)(double* c, const double* a, const double* b);
};

inline constexpr double kBehindCost = 1e4;

const SolverKernels& baseline_kernels();
// The fastest that this processor runs.
const SolverKernels& solver_kernels();

}  // namespace dkb::solver
