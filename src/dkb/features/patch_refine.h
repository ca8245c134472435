// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

struct PatchRefineOptions {
  int size = 8;               // [px] side of the patch, 6 ... 10
  int max_iterations = 10;    // >= 1
  double epsilon = 0.02;      // [px] a smaller step ends the search, > 0
  double max_shift = 4;       // [px] from the initial position, > 0
  double max_residual = 20;   // [grey levels] root mean square after the mean offset, > 0
  double min_eigenvalue = 1;  // [(grey levels / px)^2] of the patch's structure tensor about its mean slope, >= 0
  void check() const;         // throws InvalidOption
};

// Grey values about a point, with a rim of one pixel for the slopes: (size + 2)^2 of them, row-major.
struct ReferencePatch {
  std::array<uint8_t, 144> pixels{};
  bool operator==(const ReferencePatch&) const = default;
};

struct PatchAlignment {
  Eigen::Vector2f position{0, 0};  // [px] of the image searched; the last estimate when not converged
  bool converged = false;
  float residual = 0;  // [grey levels] root mean square difference after removing its mean
  int iterations = 0;
};

// Finds where a patch lies below the pixel by inverse-compositional Lucas-Kanade with an additive brightness offset
// (Baker and Matthews, IJCV 2004; as used after projection in Forster et al., ICRA 2014, section IV-B).
class PatchRefiner {
 public:
  explicit PatchRefiner(PatchRefineOptions options = {}, Simd simd = best_simd());

  // The patch about `point` [px of `image`] as it would look in the current view: the sample at offset o [px] from its
  // middle is taken at point + reference_from_current * o. False when part of it lies outside the image.
  bool take(const GreyImage& image, const Eigen::Vector2f& point, const Eigen::Matrix2f& reference_from_current,
            ReferencePatch& patch) const;

  // Position of the patch in `image`, starting at `start`; both in pixels of that image or pyramid level.
  PatchAlignment refine(const ReferencePatch& patch, const GreyImage& image, const Eigen::Vector2f& start) const;

  const PatchRefineOptions& options() const { return options_; }

 private:
  PatchRefineOptions options_;
  Simd simd_;
};

}  // namespace dkb
