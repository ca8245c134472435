// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "dkb/geometry/rigid3.h"

namespace dkb {

// Similarity between frames: point_in_to = scale * (rotation * point_in_from) + translation.
struct Similarity3 {
  double scale = 1.0;
  Rigid3 motion;  // to_from_from; its translation is applied after scaling

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return scale * (motion.rotation * point) + motion.translation;
  }
};

// The similarity (rigid motion when not `with_scale`) that minimises the sum over i of |to[i] - S * from[i]|^2, in
// closed form (Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991).
// Points in a line or in one place leave the rotation partly free: one of the minimisers is returned, always the same.
// With `with_scale` and all of `from` in one place the scale is 1. Throws InputError when the spans differ in length
// or are empty.
Similarity3 align_umeyama(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, bool with_scale);

}  // namespace dkb
