// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/timing_calibration.h"

#include <algorithm>
#include <cmath>

#include "dkb/geometry/decompositions.h"

namespace dkb {
namespace {
constexpr int kMinMatches = 30;
// Errors of one point in one frame and in the next go together; MotionNoise has the same figure for poses.
constexpr double kTogether = 4;
// [s] No delay is known better than that: the map remembers what was believed when its points were made.
constexpr double kSurest = 0.0005;
constexpr int kAround = 5;  // [px] from a corner to where its surface's slope is measured

// [s] A sensor takes no longer than a frame to be read, and a stamp is of the frame's own time.
double longest(const Camera& camera) {
  return camera.fps > 0 ? std::min(kMaxReadout, 1 / camera.fps) : kMaxReadout;
}

// What a delay leaves unexplained: error = J pose + pattern * delay, in units of the noise.
struct DelayEquations {
  Vector6d with_pose = Vector6d::Zero();
  double square = 0, gradient = 0;

  void add(const Vector6d& pose, double pattern, double error) {
    with_pose += pose * pattern;
    square += pattern * pattern;
    gradient += pattern * error;
  }
};

// [m/px] Of the depth where a corner lies, along columns and rows; nothing where the surface is not flat there.
std::optional<Eigen::Vector2d> slope_at(const DepthImage& depth, const Eigen::Vector2f& pixel,
                                        const SensorNoise& noise) {
  const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
  if (!depth.contains(x - kAround, y - kAround) || !depth.contains(x + kAround, y + kAround)) return std::nullopt;
  const double here = depth(x, y), left = depth(x - kAround, y), right = depth(x + kAround, y),
               above = depth(x, y - kAround), below = depth(x, y + kAround);
  if (!(std::min({here, left, right, above, below}) > 0)) return std::nullopt;
  const double bend = noise.max_depth_jump(here, 0, 1);
  if (std::abs((left + right) / 2 - here) > bend || std::abs((above + below) / 2 - here) > bend) return std::nullopt;
  return Eigen::Vector2d(right - left, below - above) / (2 * kAround);
}
}  // namespace

TimingCalibration::TimingCalibration(const Optics& optics, bool learn_readout, bool learn_depth_offset)
    : optics_(optics) {
  const double most = longest(optics.camera), usual = 12 / (most * most);  // of what is as likely anywhere in `most`
  Camera& camera = optics_.camera;
  // Until rows tell, the first one is taken to be read first, as in cameras that are not mounted upside down.
  readout_ = {camera.readout != 0 || !learn_readout, -most, most, usual};
  depth_offset_ = {camera.depth_time_offset != 0 || !learn_depth_offset, -most, most, usual};
  if (!readout_.known) camera.readout = most / 2;
}

void TimingCalibration::add(const TrackedFrame& frame, const DepthImage& depth, const Vector6d& velocity,
                            const std::vector<std::optional<Eigen::Vector3d>>& positions) {
  if (known() || velocity.isZero()) return;
  Camera& camera = optics_.camera;
  Matrix6d pose_pose = Matrix6d::Zero();
  Vector6d pose_gradient = Vector6d::Zero();
  DelayEquations rows, depths;
  int matches = 0;
  for (size_t f = 0; f < frame.points.size(); ++f) {
    if (!positions[f]) continue;
    const Eigen::Vector3d p = frame.cam_from_world * *positions[f];
    if (p.z() < 0.1) continue;
    const Keypoint& k = frame.features->keypoints[f];
    if (k.lent_depth > 0) continue;  // beside a depth step it slides along the outline, which no pose explains either
    const Eigen::Matrix<double, 2, 6> jacobian = pixel_by_motion(camera, p);
    const Eigen::Vector2d error = k.pixel.cast<double>() - camera.project(p);
    const double row = k.image_pixel.y() / camera.height - 0.5, per_sigma = 1 / optics_.corner_sigma(k);
    for (int axis = 0; axis < 2; ++axis) {
      const Vector6d j = per_sigma * jacobian.row(axis).transpose();
      pose_pose += j * j.transpose();
      pose_gradient += j * (per_sigma * error[axis]);
      rows.add(j, j.dot(velocity) * row, per_sigma * error[axis]);
    }
    ++matches;
    if (depth_offset_.known || !(k.depth > 0)) continue;
    const auto slope = slope_at(depth, k.image_pixel, optics_.noise);
    if (!slope) continue;
    // The depth in a pixel changes as the point's own, less what the slope makes of the point's way through the image.
    const double per_depth_sigma = 1 / optics_.noise.depth_sigma(p.z());
    Vector6d j;
    j << 0, 0, 1, p.y(), -p.x(), 0;
    j = per_depth_sigma * (j - jacobian.transpose() * *slope);
    const double off = per_depth_sigma * (k.depth - p.z() - slope->dot(error));
    pose_pose += j * j.transpose();
    pose_gradient += j * off;
    depths.add(j, j.dot(velocity), off);
  }
  if (matches < kMinMatches) return;
  if (!(spectrum(pose_pose).values[0] > 0)) return;
  const auto learn = [&](const DelayEquations& told, Delay& delay, double& value) {
    if (delay.known) return;
    const Vector6d explained = solve_symmetric(pose_pose, told.with_pose);
    const double gradient = (told.gradient - explained.dot(pose_gradient)) / kTogether;
    delay.information += std::max(0.0, told.square - explained.dot(told.with_pose)) / kTogether;
    delay.information = std::min(delay.information, 1 / (kSurest * kSurest));
    value = std::clamp(value + gradient / delay.information, delay.smallest, delay.largest);
  };
  learn(rows, readout_, camera.readout);
  learn(depths, depth_offset_, camera.depth_time_offset);
}

}  // namespace dkb
