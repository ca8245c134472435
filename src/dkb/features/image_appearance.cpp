// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/image_appearance.h"

#include <cmath>

namespace dkb {

Look ImageAppearance::look(const Eigen::Vector2d& pixel, double depth, int octave, const Descriptor& descriptor) {
  constexpr int kSameBits = 80, kOtherBits = 100;  // two random descriptors differ by 128
  const Eigen::Vector2f at = camera_.distort(pixel).cast<float>();
  const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
  if (!depth_.contains(x, y) || !(depth_(x, y) > 0)) return Look::unknown;
  const double seen = depth_(x, y);
  if (seen < depth - noise_.surface_tolerance(depth)) return Look::unknown;  // hidden, if only by a hand's breadth
  // Gone: what lies behind it is seen. It may have been taken away, which happens in every place.
  if (seen > depth + noise_.point_tolerance(depth)) return Look::unknown;
  const auto bits = describer_.distance(at.x(), at.y(), octave, descriptor);
  if (!bits || (*bits > kSameBits && *bits < kOtherBits)) return Look::unknown;
  return *bits <= kSameBits ? Look::same : Look::other;
}

}  // namespace dkb
