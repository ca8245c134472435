// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_smoother.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace dkb {
namespace {

using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;
using Matrix12x6d = Eigen::Matrix<double, 12, 6>;

// After so long without a pose the speed before says nothing: at half the density that noise starts with, the
// prediction is 0.1 m off.
constexpr double kMaxGap = 1.0;  // [s]
// Stamps closer than this do not tell how the camera moves from one to the other: at 1 m/s it is 0.1 mm, less than any
// pose is known to, and the noise of a motion is learned by dividing by the third power of its time.
constexpr double kLeastStep = 1e-4;  // [s]
// A pose is hardly told anything by one that is as many poses away as kMargin. Parts are bounded so that memory is, and
// so that each has the noise of its own time.
constexpr size_t kPart = 512, kMargin = 64;
constexpr double kStartSpeed = 1.0;    // [m/s] standard deviation of the speed at first
constexpr double kStartTurning = 1.0;  // [rad/s] of the angular one

// Errors of a state are [position in the world, velocity in the world, right perturbation of the rotation, angular
// velocity in camera axes].
constexpr int kPosition = 0, kVelocity = 3, kRotation = 6, kTurning = 9;

struct Motion {
  Eigen::Vector3d position, velocity;
  Eigen::Quaterniond rotation;  // world from camera
  Eigen::Vector3d turning;      // [rad/s] camera axes

  Motion plus(const Vector12d& d) const {
    return {position + d.segment<3>(kPosition), velocity + d.segment<3>(kVelocity),
            (rotation * rotation_from_vector(d.segment<3>(kRotation))).normalized(), turning + d.segment<3>(kTurning)};
  }
  Vector12d minus(const Motion& from) const {
    Vector12d d;
    d << position - from.position, velocity - from.velocity, vector_from_rotation(from.rotation.conjugate() * rotation),
        turning - from.turning;
    return d;
  }
  Motion after(double seconds) const {
    return {position + seconds * velocity, velocity, rotation * rotation_from_vector(seconds * turning), turning};
  }
  Matrix12d transition(double seconds) const {  // of small errors
    Matrix12d f = Matrix12d::Identity();
    f.block<3, 3>(kPosition, kVelocity).diagonal().setConstant(seconds);
    f.block<3, 3>(kRotation, kRotation) = rotation_from_vector(-seconds * turning).toRotationMatrix();
    f.block<3, 3>(kRotation, kTurning).diagonal().setConstant(seconds);
    return f;
  }
};

// Of white acceleration of unit density over some time, for a coordinate and its velocity.
Eigen::Matrix2d process_covariance(double dt) {
  Eigen::Matrix2d q;
  q << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
  return q;
}

// The rows and columns of a pose.
Matrix6d of_pose(const Matrix12d& m) {
  Matrix6d p;
  p << m.block<3, 3>(kPosition, kPosition), m.block<3, 3>(kPosition, kRotation), m.block<3, 3>(kRotation, kPosition),
      m.block<3, 3>(kRotation, kRotation);
  return p;
}
Matrix12x6d pose_columns(const Matrix12d& m) {
  Matrix12x6d c;
  c << m.middleCols<3>(kPosition), m.middleCols<3>(kRotation);
  return c;
}

class Smoother {
 public:
  Smoother(std::span<const MeasuredPose> measured, const MotionNoise& noise) : measured_(measured), noise_(noise) {
    steps_.resize(measured.size());
  }

  std::vector<Rigid3> poses(int passes) {
    for (int pass = 1; pass < passes; ++pass) {
      forward();
      backward();
      learn_noise();
    }
    forward();
    backward();
    std::vector<Rigid3> poses;
    for (size_t k = 0; k < steps_.size(); ++k) {
      const Motion& m = steps_[k].smoothed;
      const bool finite = m.position.allFinite() && m.rotation.coeffs().allFinite();
      poses.push_back(finite ? Rigid3{m.rotation, m.position} : measured_[k].world_from_cam);
    }
    return poses;
  }

 private:
  struct Step {
    Matrix12d transition, predicted_covariance, covariance, smoothed_covariance;
    Matrix12d gain;  // of the pass backwards, from the next step
    Matrix6d measurement_covariance;
    Motion predicted, filtered, smoothed;
  };

  double seconds_since_last(size_t k) const { return measured_[k].time - measured_[k - 1].time; }

  Vector6d residual(size_t k, const Motion& motion) const {
    const Rigid3& z = measured_[k].world_from_cam;
    Vector6d r;
    r << z.translation - motion.position, vector_from_rotation(motion.rotation.conjugate() * z.rotation);
    return r;
  }

  void predict(size_t k) {
    Step& s = steps_[k];
    if (k == 0) {
      const Rigid3& z = measured_[0].world_from_cam;
      s.predicted = {z.translation, Eigen::Vector3d::Zero(), z.rotation, Eigen::Vector3d::Zero()};
      s.predicted_covariance.setZero();
      // The pose itself is known by its measurement alone: far less by what is assumed before.
      s.predicted_covariance.diagonal() << Eigen::Vector3d::Constant(1), Eigen::Vector3d::Constant(kStartSpeed),
          Eigen::Vector3d::Constant(1), Eigen::Vector3d::Constant(kStartTurning);
      return;
    }
    const Step& last = steps_[k - 1];
    const double dt = seconds_since_last(k);
    s.predicted = last.filtered.after(dt);
    s.transition = last.filtered.transition(dt);
    s.predicted_covariance = s.transition * last.covariance * s.transition.transpose();
    const Eigen::Matrix2d q = process_covariance(dt);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        s.predicted_covariance.block<3, 3>(3 * i, 3 * j).diagonal().array() += noise_.acceleration * q(i, j);
        s.predicted_covariance.block<3, 3>(kRotation + 3 * i, kRotation + 3 * j).diagonal().array() +=
            noise_.angular * q(i, j);
      }
    }
  }

  void forward() {
    for (size_t k = 0; k < steps_.size(); ++k) {
      predict(k);
      Step& s = steps_[k];
      Matrix6d to_world = Matrix6d::Identity();
      to_world.topLeftCorner<3, 3>() = s.predicted.rotation.toRotationMatrix();
      s.measurement_covariance = to_world * measured_[k].covariance * to_world.transpose();
      const Eigen::LLT<Matrix6d> innovation(of_pose(s.predicted_covariance) +
                                            noise_.measurement * s.measurement_covariance);
      const Matrix12x6d columns = pose_columns(s.predicted_covariance);
      const Eigen::Matrix<double, 6, 12> gain = innovation.solve(columns.transpose());
      s.filtered = s.predicted.plus(gain.transpose() * residual(k, s.predicted));
      s.covariance = s.predicted_covariance - gain.transpose() * columns.transpose();
      s.covariance = (0.5 * (s.covariance + s.covariance.transpose())).eval();
    }
  }

  void backward() {
    steps_.back().smoothed = steps_.back().filtered;
    steps_.back().smoothed_covariance = steps_.back().covariance;
    for (size_t k = steps_.size() - 1; k-- > 0;) {
      Step& s = steps_[k];
      const Step& next = steps_[k + 1];
      const Eigen::LLT<Matrix12d> predicted(next.predicted_covariance);
      s.gain = predicted.solve(next.transition * s.covariance).transpose();
      s.smoothed = s.filtered.plus(s.gain * next.smoothed.minus(next.predicted));
      s.smoothed_covariance =
          s.covariance + s.gain * (next.smoothed_covariance - next.predicted_covariance) * s.gain.transpose();
    }
  }

  // The noise under which the smoothed motion, with all its uncertainty, is most likely.
  void learn_noise() {
    double acceleration = 0, angular = 0, measurement = 0;
    for (size_t k = 0; k < steps_.size(); ++k) {
      const Step& s = steps_[k];
      const Vector6d r = residual(k, s.smoothed);
      const Eigen::LLT<Matrix6d> covariance(s.measurement_covariance);
      measurement += covariance.solve(r * r.transpose() + of_pose(s.smoothed_covariance)).trace() / 6;
      if (k == 0) continue;
      const Step& last = steps_[k - 1];
      const double dt = seconds_since_last(k);
      const Vector12d shock = s.smoothed.minus(last.smoothed.after(dt));
      const Matrix12d crossed = s.transition * last.gain * s.smoothed_covariance;
      const Matrix12d seen = shock * shock.transpose() + s.smoothed_covariance +
                             s.transition * last.smoothed_covariance * s.transition.transpose() - crossed -
                             crossed.transpose();
      const Eigen::Matrix2d information = process_covariance(dt).inverse();
      for (int axis = 0; axis < 3; ++axis) {
        const auto spread = [&](int at) {
          Eigen::Matrix2d m;
          m << seen(at, at), seen(at, at + 3), seen(at + 3, at), seen(at + 3, at + 3);
          return (information * m).trace() / 2;
        };
        acceleration += spread(kPosition + axis) / 3;
        angular += spread(kRotation + axis) / 3;
      }
    }
    const auto n = static_cast<double>(steps_.size());
    noise_ = {acceleration / (n - 1), angular / (n - 1), measurement / n};
  }

  std::span<const MeasuredPose> measured_;
  MotionNoise noise_;
  std::vector<Step> steps_;
};

}  // namespace

std::vector<Rigid3> smoothed_poses(std::span<const MeasuredPose> measured, MotionNoise start, int passes) {
  std::vector<Rigid3> poses;
  poses.reserve(measured.size());
  while (poses.size() < measured.size()) {
    // The poses from here to the next gap, or a part of them.
    const size_t from = poses.size();
    const auto breaks = [](const MeasuredPose& a, const MeasuredPose& b) {
      return b.time - a.time > kMaxGap || b.time - a.time < kLeastStep;
    };
    const auto stretch = measured.subspan(from, std::min(kPart + kMargin, measured.size() - from));
    const auto gap = std::adjacent_find(stretch.begin(), stretch.end(), breaks);
    size_t end = from + (gap == stretch.end() ? stretch.size() : static_cast<size_t>(gap - stretch.begin()) + 1);
    size_t begin = from;
    while (begin > 0 && from - begin < kMargin && !breaks(measured[begin - 1], measured[begin])) --begin;
    const std::vector<Rigid3> part =
        end - begin < 3 ? std::vector<Rigid3>() : Smoother(measured.subspan(begin, end - begin), start).poses(passes);
    // The margin's poses come with the next part, unless nothing follows.
    const size_t last = gap == stretch.end() && end < measured.size() ? from + kPart : end;
    for (size_t k = from; k < last; ++k) poses.push_back(part.empty() ? measured[k].world_from_cam : part[k - begin]);
  }
  return poses;
}

}  // namespace dkb
