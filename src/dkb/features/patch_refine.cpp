// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/patch_refine.h"

#include <algorithm>
#include <cmath>

#include "dkb/features/lucas_kanade.h"
#include "dkb/util/errors.h"

namespace dkb {

void PatchRefineOptions::check() const {
  require_option(size >= 6 && size <= 10, "size", size, "in 6 ... 10");
  require_option(max_iterations >= 1, "max_iterations", max_iterations, ">= 1");
  require_option(epsilon > 0, "epsilon", epsilon, "> 0");
  require_option(max_shift > 0, "max_shift", max_shift, "> 0");
  require_option(max_residual > 0, "max_residual", max_residual, "> 0");
  require_option(min_eigenvalue >= 0, "min_eigenvalue", min_eigenvalue, ">= 0");
}

PatchRefiner::PatchRefiner(PatchRefineOptions options, Simd simd) : options_(options), simd_(simd) {
  options_.check();
}

bool PatchRefiner::take(const GreyImage& image, const Eigen::Vector2f& point,
                        const Eigen::Matrix2f& reference_from_current, ReferencePatch& patch) const {
  const int side = options_.size + 2;
  const float first = static_cast<float>(-(side / 2)), last = static_cast<float>(side - 1 - side / 2);
  const float right = static_cast<float>(image.width() - 1), bottom = static_cast<float>(image.height() - 1);
  for (const float u : {first, last})
    for (const float v : {first, last}) {
      const Eigen::Vector2f corner = point + reference_from_current * Eigen::Vector2f(u, v);
      if (!(corner.x() >= 0 && corner.y() >= 0 && corner.x() < right && corner.y() < bottom)) return false;
    }
  uint8_t* out = patch.pixels.data();
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const Eigen::Vector2f at = point + reference_from_current * Eigen::Vector2f(first + static_cast<float>(column),
                                                                                  first + static_cast<float>(row));
      const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
      const float fx = at.x() - static_cast<float>(x), fy = at.y() - static_cast<float>(y);
      const uint8_t* upper = image.row(y) + x;
      const uint8_t* lower = upper + image.width();
      const float value = (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) + fy * ((1 - fx) * lower[0] + fx * lower[1]);
      *out++ = static_cast<uint8_t>(value + 0.5F);
    }
  return true;
}

PatchAlignment PatchRefiner::refine(const ReferencePatch& patch, const GreyImage& image,
                                    const Eigen::Vector2f& start) const {
  const int size = options_.size;
  PatchAlignment result;
  result.position = start;
  if (!start.allFinite()) return result;
  alignas(32) LkSamples samples;
  LkTemplate reference;
  for (int row = 0; row < size + 2; ++row)
    for (int i = 0; i < size + 2; ++i)
      samples[row * kLkStride + i] =
          static_cast<int16_t>(kLkOne * patch.pixels[static_cast<size_t>(row * (size + 2) + i)]);
  lk_make_template(samples, size, reference);

  // Solving for an offset as well is the same as taking all slopes relative to their mean.
  const double n = size * size;
  const double sum_dx = static_cast<double>(reference.sum_dx), sum_dy = static_cast<double>(reference.sum_dy);
  const double xx = static_cast<double>(reference.sum_xx) - sum_dx * sum_dx / n;
  const double xy = static_cast<double>(reference.sum_xy) - sum_dx * sum_dy / n;
  const double yy = static_cast<double>(reference.sum_yy) - sum_dy * sum_dy / n;
  const double smaller = 0.5 * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) / (32.0 * 32.0 * n);
  const double determinant = xx * yy - xy * xy;
  if (smaller < options_.min_eigenvalue || determinant <= 0) return result;

  double x = start.x(), y = start.y();
  while (result.iterations < options_.max_iterations && !result.converged) {
    if (!lk_fits(image, x, y, size)) break;
    ++result.iterations;
    lk_sample(image, x, y, size, samples, simd_);
    const LkSums sums = lk_sums(reference, samples, simd_);
    const double d = static_cast<double>(sums.d);
    result.residual =
        static_cast<float>(std::sqrt(std::max(0.0, static_cast<double>(sums.squared) - d * d / n) / n) / kLkOne);
    const double bx = static_cast<double>(sums.dx) - sum_dx * d / n;
    const double by = static_cast<double>(sums.dy) - sum_dy * d / n;
    // Differences in 1/16, slopes in 1/32 grey levels: hence the factor 2.
    const double step_x = 2.0 * (xy * by - yy * bx) / determinant;
    const double step_y = 2.0 * (xy * bx - xx * by) / determinant;
    x += step_x;
    y += step_y;
    if (std::abs(x - start.x()) > options_.max_shift || std::abs(y - start.y()) > options_.max_shift) break;
    result.position = {static_cast<float>(x), static_cast<float>(y)};
    result.converged = step_x * step_x + step_y * step_y < options_.epsilon * options_.epsilon;
  }
  result.converged = result.converged && result.residual <= options_.max_residual;
  return result;
}

}  // namespace dkb
