// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/readout_calibration.h"

#include <algorithm>

#include "dkb/geometry/decompositions.h"

namespace dkb {
namespace {
constexpr int kMinMatches = 30;
// Errors of one point in one frame and in the next go together; MotionNoise has the same figure for poses.
constexpr double kTogether = 4;

// [s] largest readout believed in: no sensor takes longer than a frame. Before anything is seen of it each below is as
// likely.
double max_readout(const Camera& camera) {
  return camera.fps > 0 ? std::min(kMaxReadout, 1 / camera.fps) : kMaxReadout;
}
}  // namespace

ReadoutCalibration::ReadoutCalibration(const Optics& optics, bool estimate)
    : optics_(optics),
      known_(optics.camera.readout > 0 || !estimate),
      max_readout_(max_readout(optics.camera)),
      readout_(known_ ? optics.camera.readout : max_readout_ / 2),
      information_(12 / (max_readout_ * max_readout_)) {}

void ReadoutCalibration::add(const TrackedFrame& frame, const Vector6d& velocity,
                             const std::vector<std::optional<Eigen::Vector3d>>& positions) {
  if (known_ || velocity.isZero()) return;
  // Normal equations of [pose, readout]: pixel error = J pose + d readout.
  Matrix6d pose_pose = Matrix6d::Zero();
  Vector6d pose_readout = Vector6d::Zero(), pose_gradient = Vector6d::Zero();
  double readout_readout = 0, readout_gradient = 0;
  int matches = 0;
  for (size_t f = 0; f < frame.points.size(); ++f) {
    const auto& position = positions[f];
    if (!position) continue;
    const Eigen::Vector3d p = frame.cam_from_world * *position;
    if (p.z() < 0.1) continue;
    const Keypoint& k = frame.features->keypoints[f];
    if (k.lent_depth > 0) continue;  // beside a depth step it slides along the outline, which no pose explains either
    const Eigen::Matrix<double, 2, 6> jacobian = pixel_by_motion(optics_.camera, p);
    const Eigen::Vector2d flow = jacobian * velocity;
    const Eigen::Vector2d late = flow * (k.image_pixel.y() / optics_.camera.height - 0.5);
    const Eigen::Vector2d error = k.pixel.cast<double>() - optics_.camera.project(p);
    const double weight = 1 / optics_.corner_variance(k);
    pose_pose += weight * jacobian.transpose() * jacobian;
    pose_readout += weight * jacobian.transpose() * late;
    pose_gradient += weight * jacobian.transpose() * error;
    readout_readout += weight * late.squaredNorm();
    readout_gradient += weight * late.dot(error);
    ++matches;
  }
  if (matches < kMinMatches) return;
  if (!(spectrum(pose_pose).values[0] > 0)) return;
  const Vector6d explained = solve_symmetric(pose_pose, pose_readout);
  const double gradient = (readout_gradient - explained.dot(pose_gradient)) / kTogether;
  information_ += std::max(0.0, readout_readout - explained.dot(pose_readout)) / kTogether;
  readout_ = std::clamp(readout_ + gradient / information_, 0.0, max_readout_);
}

}  // namespace dkb
