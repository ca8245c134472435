// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/optical_flow.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dkb/features/lucas_kanade.h"
#include "dkb/util/errors.h"

namespace dkb {

namespace {
constexpr double kCoarseEpsilon = 0.1;  // [px of the level]
}

void OpticalFlowOptions::check() const {
  require_option(window >= 5 && window <= kLkMaxSize && window % 2 == 1, "window", window, "odd and in 5 ... 29");
  require_option(levels >= 1 && levels <= 16, "levels", levels, "in 1 ... 16");
  require_option(max_iterations >= 1, "max_iterations", max_iterations, ">= 1");
  require_option(epsilon > 0, "epsilon", epsilon, "> 0");
  require_option(min_eigenvalue >= 0, "min_eigenvalue", min_eigenvalue, ">= 0");
  require_option(max_residual > 0, "max_residual", max_residual, "> 0");
}

OpticalFlow::OpticalFlow(OpticalFlowOptions options, Simd simd) : options_(options), simd_(simd) {
  options_.check();
}

FlowResult OpticalFlow::track_one(const ImagePyramid& previous, const ImagePyramid& current,
                                  const Eigen::Vector2f& point, const Eigen::Vector2f& guess) const {
  const int size = options_.window;
  const double samples_count = size * size;
  alignas(32) LkSamples samples;
  LkTemplate reference;
  FlowResult result;
  double full_x = guess.x(), full_y = guess.y();
  if (!std::isfinite(full_x) || !std::isfinite(full_y) || !point.allFinite()) return result;
  for (int level = std::min({options_.levels, previous.levels(), current.levels()}) - 1; level >= 0; --level) {
    const GreyImage& target = current.level(level);
    const double from_x = previous.level_x(level, point.x()), from_y = previous.level_y(level, point.y());
    if (!lk_fits(previous.level(level), from_x, from_y, size + 2)) continue;
    lk_sample(previous.level(level), from_x, from_y, size + 2, samples, simd_);
    lk_make_template(samples, size, reference);

    // Slopes are in 1/16 grey level per 2 px: 32 of them are one grey level per pixel.
    const double scale = 1.0 / (32.0 * 32.0 * samples_count);
    const double xx = static_cast<double>(reference.sum_xx), xy = static_cast<double>(reference.sum_xy);
    const double yy = static_cast<double>(reference.sum_yy);
    const double smaller = 0.5 * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) * scale;
    const double determinant = xx * yy - xy * xy;
    if (smaller < options_.min_eigenvalue || determinant <= 0) continue;

    double x = current.level_x(level, full_x), y = current.level_y(level, full_y);
    bool inside = true;
    // Coarse levels only have to bring the finer one near.
    const double epsilon = level == 0 ? options_.epsilon : std::max(options_.epsilon, kCoarseEpsilon);
    for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
      inside = lk_fits(target, x, y, size);
      if (!inside) break;
      lk_sample(target, x, y, size, samples, simd_);
      const LkSums sums = lk_sums(reference, samples, simd_);
      if (level == 0)
        result.residual = static_cast<float>(static_cast<double>(sums.absolute) / (kLkOne * samples_count));
      const double bx = static_cast<double>(sums.dx), by = static_cast<double>(sums.dy);
      // Differences in 1/16, slopes in 1/32 grey levels: hence the factor 2.
      const double step_x = 2.0 * (xy * by - yy * bx) / determinant;
      const double step_y = 2.0 * (xy * bx - xx * by) / determinant;
      x += step_x;
      y += step_y;
      if (step_x * step_x + step_y * step_y < epsilon * epsilon) break;
    }
    inside = inside && lk_fits(target, x, y, size);
    if (!inside && level > 0) continue;  // the finer level begins where this one did
    full_x = current.full_x(level, x);
    full_y = current.full_y(level, y);
    if (level == 0) result.found = inside && result.residual <= options_.max_residual;
  }
  result.position = {static_cast<float>(full_x), static_cast<float>(full_y)};
  return result;
}

std::vector<FlowResult> OpticalFlow::track(const ImagePyramid& previous, const ImagePyramid& current,
                                           std::span<const Eigen::Vector2f> points,
                                           std::span<const Eigen::Vector2f> guesses) const {
  if (previous.levels() == 0 || current.levels() == 0 || previous.level(0).width() != current.level(0).width() ||
      previous.level(0).height() != current.level(0).height())
    throw InputError("optical flow: the two pyramids are of different size; build both from images of one camera");
  if (!guesses.empty() && guesses.size() != points.size())
    throw InputError("optical flow: there are " + std::to_string(guesses.size()) + " guesses for " +
                     std::to_string(points.size()) + " points; give one per point or none");
  std::vector<FlowResult> results;
  results.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i)
    results.push_back(track_one(previous, current, points[i], guesses.empty() ? points[i] : guesses[i]));
  return results;
}

}  // namespace dkb
