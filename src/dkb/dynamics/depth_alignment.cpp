// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/depth_alignment.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "dkb/geometry/decompositions.h"

namespace dkb {
namespace {

constexpr int kStride = 3;        // [cells] between those that are asked
constexpr int kReach = 3;         // [cells] to both sides, over which a normal is taken
constexpr int kIterations = 6;    // at most
constexpr double kTukey = 4.685;  // [standard deviations]: 95 % efficiency with Gaussian noise
constexpr int kBlock = 24;        // [cells] over which distances that hang together are looked for
constexpr size_t kEnoughBlocks = 4;
// What the sensor's calibration is off by hangs together over more than a block: so many blocks say no more than one.
// Chosen by measurement: with 2 somebody who starts to walk takes the camera along (docs/decisions.md).
constexpr double kTogether = 12;
constexpr double kFrameShare = 0.1;  // of a frame in what is known of how much hangs together
constexpr size_t kEnoughCells = 100;
constexpr double kSmallStep = 1e-3, kSmallTurn = 0.5e-3;  // [m, rad] a third of what they are off is left after one
constexpr double kExact = 1e-6;                           // [m, rad] closer than anything is told
constexpr double kDoubtLeft = 0.25;                       // of the variance, by one iteration

// What the cells say: each a row [n, p x n] of the Jacobian, its distance, and how that changes with the readout [m/s].
// Summed in rows of eight floats, which are whole registers.
class PlaneSums {
 public:
  // `weighted_slope`: the cell's weight times the variance of its normal's slope.
  void add(const Eigen::Vector3f& normal, const Eigen::Vector3f& point, float distance, float by_readout, float weight,
           float weighted_slope) {
    const Eigen::Vector3f lever = point.cross(normal);
    Row row;
    row << normal[0], normal[1], normal[2], lever[0], lever[1], lever[2], distance, by_readout;
    const Eigen::Vector4f place(point[0], point[1], point[2], 1);
    squares_.noalias() += weight * row * row.transpose();
    along_.noalias() += weighted_slope * row * row.transpose();
    places_.noalias() += weighted_slope * place * place.transpose();
    ++cells_;
  }
  size_t cells() const { return cells_; }
  Matrix6d information() const { return squares_.topLeftCorner<6, 6>().cast<double>(); }
  Vector6d gradient() const { return squares_.col(6).head<6>().cast<double>(); }
  struct OfReadout {
    double information = 0, gradient = 0;  // [1/s^2], [1/s]
  };
  // What they say of the readout, from the normal equations of [step, readout] with the step eliminated. `information`
  // is that of the step, by which it would be `step` if the readout were right.
  OfReadout of_readout(double cells_like_one, const Matrix6d& information, const Vector6d& step) const {
    const Vector6d both = squares_.col(7).head<6>().cast<double>() / cells_like_one;
    return {squares_(7, 7) / cells_like_one - both.dot(solve_symmetric(information, both)),
            squares_(6, 7) / cells_like_one + both.dot(step)};
  }
  // What the noise of the normals adds to the information. A normal n is off across itself, so that the row of a cell
  // at p is off by A (I - n n^T) A^T times the variance of the slope, with A = [I, [p]x].
  Matrix6d noise() const {
    const Eigen::Matrix4d places = places_.cast<double>();
    const Eigen::Matrix3d point = skew(places.col(3).head<3>()), square = places.topLeftCorner<3, 3>();
    Matrix6d all;
    all.topLeftCorner<3, 3>() = places(3, 3) * Eigen::Matrix3d::Identity();
    all.bottomLeftCorner<3, 3>() = point;
    all.topRightCorner<3, 3>() = -point;
    all.bottomRightCorner<3, 3>() = square.trace() * Eigen::Matrix3d::Identity() - square;
    return all - along_.topLeftCorner<6, 6>().cast<double>();
  }

 private:
  using Row = Eigen::Matrix<float, 8, 1>;

  size_t cells_ = 0;
  Eigen::Matrix<float, 8, 8> squares_ = Eigen::Matrix<float, 8, 8>::Zero();
  Eigen::Matrix<float, 8, 8> along_ = Eigen::Matrix<float, 8, 8>::Zero();
  Eigen::Matrix4f places_ = Eigen::Matrix4f::Zero();
};

// How much more the distances of a block's cells vary together than if each had the sensor's noise of its own, which
// gives 1 (the design effect of cluster samples; Kish, Survey Sampling, 1965, section 5.4).
class HangingTogether {
 public:
  HangingTogether(int width, int height)
      : columns_((width + kBlock - 1) / kBlock),
        blocks_(static_cast<size_t>(columns_ * ((height + kBlock - 1) / kBlock))) {}

  // `distance`: in standard deviations; `weight`: 0 ... 1, of its square.
  void add(int x, int y, float distance, float weight) {
    Block& b = blocks_[static_cast<size_t>(y / kBlock * columns_ + x / kBlock)];
    b.distance += std::sqrt(weight) * distance;
    b.weight += weight;
  }
  // Nothing where too few blocks are half full.
  std::optional<double> factor() const {
    constexpr float kHalf = 0.5f * (kBlock / kStride) * (kBlock / kStride);
    double sum = 1;  // a block of nothing but the sensor's noise is expected: depths without any do not tell everything
    size_t count = 1;
    for (const Block& b : blocks_) {
      if (b.weight < kHalf) continue;
      sum += static_cast<double>(b.distance) * b.distance / b.weight;
      ++count;
    }
    if (count <= kEnoughBlocks) return std::nullopt;
    return sum / static_cast<double>(count);
  }

 private:
  struct Block {
    float distance = 0, weight = 0;
  };
  int columns_;
  std::vector<Block> blocks_;
};

// Takes the part of noise out of the information. A direction of which more than half is noise is left to the
// expectation. Directions are those of the information in units of the expectation's standard deviations.
void keep_what_is_known(const Matrix6d& expected_covariance, const Matrix6d& noise, Matrix6d* information,
                        Vector6d* gradient) {
  const Matrix6d unit = cholesky_root(expected_covariance), whitened = inverse(unit);
  const auto [values, axes] = spectrum(Matrix6d(unit.transpose() * *information * unit));
  Matrix6d kept = Matrix6d::Zero();
  Vector6d pull = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    const Vector6d axis = axes.col(i), direction = unit * axis;
    const double known = values[i] - direction.dot(noise * direction);
    if (known < values[i] / 2) continue;
    kept += known * axis * axis.transpose();
    pull += direction.dot(*gradient) * axis;
  }
  *information = whitened.transpose() * kept * whitened;
  *gradient = whitened.transpose() * pull;
}

}  // namespace

DepthAlignment::DepthAlignment(const SensorNoise& noise, double focal, const MotionRays& rays)
    : noise_(noise),
      focal_(focal),
      normals_(rays.width(), rays.height(), Eigen::Vector3f::Zero()),
      asked_(rays.width(), rays.height()),
      readout_information_(3 / (kMaxReadout * kMaxReadout)) {}  // each as likely: the mean square of what 0 is off by

// By least squares over 3 x 3 cells, kReach apart.
Eigen::Vector3f DepthAlignment::find_normal(const MotionDepthGrid& grid, const MotionRays& rays, int x, int y,
                                            const ReadoutMotion& readout) const {
  constexpr int k = kReach;
  const Image<float>& depth = grid.depth;
  if (x < k || y < k || x + k >= rays.width() || y + k >= rays.height()) return Eigen::Vector3f::Zero();
  const float z = depth(x, y);
  if (!(z > 0) || grid.score(x, y) >= kMayMove) return Eigen::Vector3f::Zero();
  const auto jump = static_cast<float>(noise_.max_depth_jump(z, k * rays.cell(), focal_));
  Eigen::Vector3f across = Eigen::Vector3f::Zero(), down = Eigen::Vector3f::Zero();
  for (int v = -1; v <= 1; ++v)
    for (int u = -1; u <= 1; ++u) {
      const float there = depth(x + k * u, y + k * v);
      if (!(there > 0) || std::abs(there - z) > jump) return Eigen::Vector3f::Zero();
      const Eigen::Vector3f place = rays.point(x + k * u, y + k * v, there, readout);
      across += static_cast<float>(u) * place;
      down += static_cast<float>(v) * place;
    }
  return across.cross(down).normalized();
}

std::optional<MotionPrior> DepthAlignment::align(const MotionDepthGrid& here, const MotionDepthGrid& there,
                                                 const MotionRays& rays, const MotionPrior& expected) {
  std::fill(asked_.data(), asked_.data() + asked_.size(), uint8_t{0});
  const auto position_variance = static_cast<float>(expected.covariance.topLeftCorner<3, 3>().trace() / 3);
  const auto rotation_variance = static_cast<float>(expected.covariance.bottomRightCorner<3, 3>().trace() / 3);
  // Steps are taken in the axes of `there`, on the left of the pose.
  Matrix6d covariance = carried(expected.previous_from_current, expected.covariance);
  covariance.diagonal().array() += kExact * kExact;
  const Matrix6d prior = inverse(covariance);
  const Rigid3 here_from_there_expected = expected.previous_from_current.inverse();
  const auto spacings_per_unit = static_cast<float>(focal_ / (kReach * rays.cell()));  // of a plane one unit away
  const double seconds = here.time - there.time;
  const ReadoutMotion there_readout(there.velocity, readout_), there_rate(there.velocity, 1);
  Rigid3 pose = expected.previous_from_current;
  Matrix6d information;
  double doubt = 1;  // share of the expectation's variance that the robust cost still allows for
  for (int iteration = 0; iteration < kIterations; ++iteration, doubt *= kDoubtLeft) {
    Vector6d velocity = Vector6d::Zero();
    if (seconds > 0) velocity = tangent_from_rigid3(pose.inverse()) / seconds;
    const ReadoutMotion here_readout(velocity, readout_), here_rate(velocity, 1);
    const Eigen::Matrix3f rotation = pose.matrix3().cast<float>();
    const Eigen::Vector3f translation = pose.translation.cast<float>();
    PlaneSums sums;
    HangingTogether blocks(rays.width(), rays.height());
    for (int y = kStride / 2; y < rays.height(); y += kStride)
      for (int x = kStride / 2; x < rays.width(); x += kStride) {
        const float depth = here.depth(x, y);
        if (!(depth > 0)) continue;
        const Eigen::Vector3f seen = rays.point(x, y, depth, here_readout);
        const Eigen::Vector3f point = rotation * seen + translation;
        int u = 0, v = 0;
        if (!rays.find_cell(point, &u, &v, there_readout)) continue;
        Eigen::Vector3f& normal = normals_(u, v);
        if (asked_(u, v) == 0) {
          normal = find_normal(there, rays, u, v, there_readout);
          asked_(u, v) = 1;
        }
        if (normal.isZero()) continue;
        const float z = there.depth(u, v);
        const Eigen::Vector3f surface = rays.point(u, v, z, there_readout);
        const float distance = normal.dot(point - surface);
        const auto sigma = static_cast<float>(noise_.flat_depth_sigma(z));
        const float variance = 2 * sigma * sigma;
        const float allowed =
            variance +
            static_cast<float>(doubt) * (position_variance + rotation_variance * point.cross(normal).squaredNorm());
        const float share = distance * distance / (static_cast<float>(kTukey * kTukey) * allowed);
        if (share >= 1) continue;
        const float trust = (1 - share) * (1 - share), weight = trust / variance;
        // The slope of a plane through nine depths, three each at -1, 0 and 1 spacings: of six squares in all.
        const float slope = sigma / z * spacings_per_unit;
        const float by_readout =
            normal.dot(rays.late(v) * there_rate.of(surface) - rays.late(y) * (rotation * here_rate.of(seen)));
        sums.add(normal, point, distance, by_readout, weight, weight * slope * slope / 6);
        blocks.add(x, y, distance / std::sqrt(variance), trust);
      }
    if (sums.cells() < kEnoughCells) return std::nullopt;
    const auto solve = [&](double hanging_together) -> Vector6d {
      const double cells_like_one = kTogether * hanging_together;
      information = sums.information() / cells_like_one;
      Vector6d gradient = sums.gradient() / cells_like_one;
      keep_what_is_known(covariance, sums.noise() / cells_like_one, &information, &gradient);
      information += prior;
      gradient += prior * tangent_from_rigid3(pose * here_from_there_expected);
      return -solve_symmetric(information, gradient);
    };
    const double usual = together_.value_or(1);
    double hanging_together = usual;
    Vector6d step = solve(usual);
    const bool settled = step.head<3>().norm() < kSmallStep && step.tail<3>().norm() < kSmallTurn;
    if (settled || iteration + 1 == kIterations) {
      // Only now the distances are the surfaces' own, and no longer those of a pose that is off.
      const std::optional<double> factor = blocks.factor();
      if (factor && *factor > usual) step = solve(hanging_together = *factor);
      const auto of_readout = sums.of_readout(kTogether * hanging_together, information, step);
      readout_information_ += std::max(0.0, of_readout.information);
      readout_ = std::clamp(readout_ - of_readout.gradient / readout_information_, -kMaxReadout, kMaxReadout);
      if (factor) together_ = together_ ? usual + kFrameShare * (*factor - usual) : *factor;
    }
    pose = rigid3_from_tangent(step) * pose;
    if (settled) break;
  }
  return MotionPrior{pose, false, carried(pose.inverse(), inverse(information))};
}

}  // namespace dkb
