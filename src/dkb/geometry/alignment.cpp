// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/alignment.h"

#include <Eigen/SVD>

#include "dkb/util/errors.h"

namespace dkb {

Similarity3 align_umeyama(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, bool with_scale) {
  if (from.empty() || from.size() != to.size())
    throw InputError("alignment: " + std::to_string(from.size()) + " and " + std::to_string(to.size()) +
                     " points given; both must be the same number, at least 1");
  const double n = static_cast<double>(from.size());
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < from.size(); ++i) from_mean += from[i], to_mean += to[i];
  from_mean /= n, to_mean /= n;

  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double variance = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    covariance += (to[i] - to_mean) * (from[i] - from_mean).transpose();
    variance += (from[i] - from_mean).squaredNorm();
  }
  covariance /= n, variance /= n;

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();  // turns a reflection into the nearest rotation (Umeyama eq. 39)
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();

  Similarity3 result;
  result.motion.rotation = Eigen::Quaterniond(rotation).normalized();
  if (with_scale && variance > 0) result.scale = svd.singularValues().dot(signs) / variance;
  result.motion.translation = to_mean - result.scale * (result.motion.rotation * from_mean);
  return result;
}

}  // namespace dkb
