// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/optical_flow.h"

#include <algorithm>
#include <cmath>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kMaxIterations = 10;                       // per level
constexpr double kEpsilon = 0.02, kCoarseEpsilon = 0.1;  // [px of the level] a smaller step ends the search
constexpr double kMinEigenvalue = 1;  // [(grey levels / px)^2] mean over the window; flatter windows are not followed
constexpr double kMaxResidual = 30;   // [grey levels] a larger mean absolute difference means lost

FlowResult track_point(const ImagePyramid& previous, const ImagePyramid& current, const Eigen::Vector2f& point,
                       Simd simd) {
  constexpr double samples_count = kFlowWindow * kFlowWindow;
  alignas(32) LkSamples samples;
  LkTemplate reference;
  FlowResult result;
  double full_x = point.x(), full_y = point.y();
  double residual = 0;  // [grey levels] mean absolute difference of the windows at full resolution
  if (!point.allFinite()) return result;
  for (int level = std::min(previous.levels(), current.levels()) - 1; level >= 0; --level) {
    const GreyImage& target = current.level(level);
    const double from_x = previous.level_x(level, point.x()), from_y = previous.level_y(level, point.y());
    if (!lk_fits(previous.level(level), from_x, from_y, kFlowRimmed)) continue;
    lk_sample(previous.level(level), from_x, from_y, kFlowRimmed, samples, simd);
    lk_make_template(samples, reference);

    // Slopes are in 1/16 grey level per 2 px: 32 of them are one grey level per pixel.
    const double scale = 1.0 / (32.0 * 32.0 * samples_count);
    const double xx = reference.sum_xx, xy = reference.sum_xy, yy = reference.sum_yy;
    const double smaller = 0.5 * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) * scale;
    const double determinant = xx * yy - xy * xy;
    if (smaller < kMinEigenvalue || determinant <= 0) continue;

    double x = current.level_x(level, full_x), y = current.level_y(level, full_y);
    bool inside = true;
    // Coarse levels only have to bring the finer one near.
    const double epsilon = level == 0 ? kEpsilon : kCoarseEpsilon;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      inside = lk_fits(target, x, y, kFlowWindow);
      if (!inside) break;
      lk_sample(target, x, y, kFlowWindow, samples, simd);
      const LkSums sums = lk_sums(reference, samples, simd);
      residual = sums.absolute / (kLkOne * samples_count);
      const double bx = sums.dx, by = sums.dy;
      // Differences in 1/16, slopes in 1/32 grey levels: hence the factor 2.
      const double step_x = 2.0 * (xy * by - yy * bx) / determinant;
      const double step_y = 2.0 * (xy * bx - xx * by) / determinant;
      x += step_x;
      y += step_y;
      if (step_x * step_x + step_y * step_y < epsilon * epsilon) break;
    }
    inside = inside && lk_fits(target, x, y, kFlowWindow);
    if (!inside && level > 0) continue;  // the finer level begins where this one did
    full_x = current.full_x(level, x);
    full_y = current.full_y(level, y);
    if (level == 0) result.found = inside && static_cast<float>(residual) <= kMaxResidual;
  }
  result.position = {static_cast<float>(full_x), static_cast<float>(full_y)};
  return result;
}

}  // namespace

std::vector<FlowResult> track_flow(const ImagePyramid& previous, const ImagePyramid& current,
                                   std::span<const Eigen::Vector2f> points, Simd simd) {
  if (previous.levels() == 0 || current.levels() == 0 || previous.level(0).width() != current.level(0).width() ||
      previous.level(0).height() != current.level(0).height())
    throw InputError("optical flow: the two pyramids are of different size; build both from images of one camera");
  std::vector<FlowResult> results;
  results.reserve(points.size());
  for (const Eigen::Vector2f& point : points) results.push_back(track_point(previous, current, point, simd));
  return results;
}

}  // namespace dkb
