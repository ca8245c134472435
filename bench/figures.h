// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Eigenvalues>
#include <utility>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/util/quantile.h"

namespace dkb {

// The value that the share `p` of them does not exceed; 0 of none.
inline double percentile(std::vector<double> values, double p) {
  return values.empty() ? 0 : quantile(values, p);
}

// Places the world of a run in the true one: truth_from_run of pairs of poses, world_from_cam of the run and of the
// truth. Mean rotation, then mean translation: positions alone say little about the rotation when the path is short.
inline Rigid3 registration(const std::vector<std::pair<Rigid3, Rigid3>>& pairs) {
  Eigen::Matrix4d quaternions = Eigen::Matrix4d::Zero();
  for (const auto& [run, truth] : pairs) {
    const Eigen::Vector4d q = (truth.rotation * run.rotation.conjugate()).coeffs();
    quaternions += q * q.transpose();
  }
  Rigid3 result;
  result.rotation.coeffs() = Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(quaternions).eigenvectors().col(3);
  for (const auto& [run, truth] : pairs)
    result.translation += (truth.translation - result.rotation * run.translation) / static_cast<double>(pairs.size());
  return result;
}

}  // namespace dkb
