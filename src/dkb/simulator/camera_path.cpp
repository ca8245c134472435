// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/camera_path.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "dkb/simulator/noise.h"

namespace dkb::sim {

Rigid3 camera_pose(const Eigen::Vector3d& position, double yaw, double pitch, double roll) {
  const Eigen::Vector3d forward(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch));
  const Eigen::Vector3d right(std::sin(yaw), -std::cos(yaw), 0), down = forward.cross(right);
  Eigen::Matrix3d r;
  r << right, down, forward;
  const Eigen::Quaterniond q(r);
  return {(q * rotation_from_vector(Eigen::Vector3d(0, 0, roll))).normalized(), position};
}

double eased(double s, double ramp) {
  s = std::clamp(s, 0.0, 1.0);
  const double v = 1 / (1 - ramp);
  if (s < ramp) return 0.5 * v * s * s / ramp;
  if (s > 1 - ramp) return 1 - 0.5 * v * (1 - s) * (1 - s) / ramp;
  return v * (s - 0.5 * ramp);
}

Tremor hand_tremor(double t, double metres, double radians, uint64_t seed) {
  const auto wave = [&](uint64_t channel, double size) {
    double sum = 0;
    for (uint64_t k = 0; k < 5; ++k) {
      const double f =
          0.4 + 0.75 * static_cast<double>(k) + 0.5 * static_cast<double>(unit_float(hash64(seed, channel, k)));
      const double phase = 6.2832 * static_cast<double>(unit_float(hash64(seed, channel, k + 100)));
      sum += std::sin(6.283185307 * f * t + phase) / (1 + 0.9 * static_cast<double>(k));
    }
    return size * sum * 0.7;
  };
  Tremor out;
  out.shift = {wave(1, metres), wave(2, metres), wave(3, metres)};
  out.yaw = wave(4, radians);
  out.pitch = wave(5, radians);
  out.roll = wave(6, radians);
  return out;
}

Rigid3 shaken(const Eigen::Vector3d& position, double yaw, double pitch, double t, double strength, uint64_t seed) {
  const Tremor h = hand_tremor(t, 0.006 * strength, 0.008 * strength, seed);
  return camera_pose(position + h.shift, yaw + h.yaw, pitch + h.pitch, h.roll);
}

CameraPath smooth_path(const std::vector<TimedPose>& poses, double sigma, double duration) {
  struct Samples {
    double start = 0;
    std::vector<Eigen::Vector3d> p;
    std::vector<Eigen::Quaterniond> q;
  };
  constexpr double kStep = 0.005;  // [s]
  const double start = poses.front().time, end = poses.back().time;
  const int half_window = static_cast<int>(std::ceil(3 * sigma / kStep));
  const double asked_for = std::min(end - start, duration + kStep * (half_window + 1));
  const auto n = static_cast<size_t>(std::floor(asked_for / kStep)) + 1;
  Samples raw;
  size_t j = 0;
  for (size_t i = 0; i < n; ++i) {
    const double t = start + kStep * static_cast<double>(i);
    while (j + 2 < poses.size() && poses[j + 1].time <= t) ++j;
    const TimedPose& a = poses[j];
    const TimedPose& b = poses[std::min(j + 1, poses.size() - 1)];
    const double w = b.time > a.time ? std::clamp((t - a.time) / (b.time - a.time), 0.0, 1.0) : 0;
    raw.p.emplace_back(a.world_from_cam.translation +
                       w * (b.world_from_cam.translation - a.world_from_cam.translation));
    Eigen::Quaterniond q = a.world_from_cam.rotation.slerp(w, b.world_from_cam.rotation);
    if (!raw.q.empty() && raw.q.back().dot(q) < 0) q.coeffs() = -q.coeffs();
    raw.q.push_back(q);
  }
  auto smooth = std::make_shared<Samples>();
  smooth->start = start;
  for (int i = 0; i < static_cast<int>(n); ++i) {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
    double sum = 0;
    // Symmetric also at the ends, where the window shrinks: no lag.
    const int r = std::min({half_window, i, static_cast<int>(n) - 1 - i});
    for (int k = -r; k <= r; ++k) {
      const double x = k * kStep / sigma, w = std::exp(-0.5 * x * x);
      p += w * raw.p[static_cast<size_t>(i + k)];
      q += w * raw.q[static_cast<size_t>(i + k)].coeffs();
      sum += w;
    }
    smooth->p.emplace_back(p / sum);
    smooth->q.push_back(Eigen::Quaterniond(q).normalized());
  }
  return [smooth](double t) {
    const double x = std::clamp((t - smooth->start) / kStep, 0.0, static_cast<double>(smooth->p.size() - 1));
    const size_t i = std::min(static_cast<size_t>(x), smooth->p.size() - 1), k = std::min(i + 1, smooth->p.size() - 1);
    const double w = x - static_cast<double>(i);
    return Rigid3(smooth->q[i].slerp(w, smooth->q[k]).normalized(), smooth->p[i] + w * (smooth->p[k] - smooth->p[i]));
  };
}

}  // namespace dkb::sim
