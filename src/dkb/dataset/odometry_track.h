// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "dkb/dataset/trajectory_file.h"
#include "dkb_slam/source.h"

namespace dkb {

inline constexpr double kUsualDrift = 0.01;     // share of a way, of wheels on a floor
inline constexpr double kMaxOdometryGap = 0.5;  // [s] between poses that motion is interpolated over
inline constexpr double kMinOdometrySd = 1e-3;  // [m, rad] of any motion: wheels slip and shake
inline constexpr double kFarthestMotion = 1e6;  // [m] no camera moves so far between two frames

// The variance [m^2, rad^2] of a motion over `way` [m, rad] by a sensor that is off by the share `drift` of it. Drift
// is systematic: over 10 m the standard deviation is that of the drift, over a shorter way more, since a sum of
// independent steps can only grow with the root of the way.
inline double drift_variance(double drift, double way) {
  constexpr double kLength = 10;  // [m, rad]
  return drift * drift * way * kLength;
}

// Of a motion by wheels over `distance` [m] and `angle` [rad]: the way and the heading are off by the drift of the way,
// the heading by the usual drift of the turn as well.
inline Matrix6d drift_covariance(double drift, double distance, double angle) {
  Matrix6d covariance = Matrix6d::Identity() * (kMinOdometrySd * kMinOdometrySd);
  covariance.diagonal().head<3>().array() += drift_variance(drift, distance);
  covariance.diagonal().tail<3>().array() += drift_variance(drift, distance) + drift_variance(kUsualDrift, angle);
  return covariance;
}

// Whether a motion can be one. Poses of finite numbers may have differences that are not.
inline bool is_plausible(const MotionPrior& prior) {
  const Rigid3& motion = prior.previous_from_current;
  return motion.translation.norm() < kFarthestMotion && motion.rotation.coeffs().allFinite() &&
         prior.covariance.allFinite();
}

// The pose at `share` (0 ... 1) of the way from one to another.
inline Rigid3 interpolated(const Rigid3& from, const Rigid3& to, double share) {
  return {from.rotation.slerp(share, to.rotation).normalized(),
          from.translation + share * (to.translation - from.translation)};
}

// Poses of a robot by its wheels, as motion priors between any two times.
class OdometryTrack {
 public:
  // Poses of the body in a frame of its own; the body's axes are the camera's. `drift`: the share of a way that its
  // length is off by, and the heading [rad/m]; a turn is off by 1% as well. Stamps must rise.
  OdometryTrack(Trajectory odom_from_body, double drift);

  // Nothing when one of the times [s] lies outside of the track, or in a gap of more than half a second, and when the
  // poses there are too far apart to be true.
  std::optional<MotionPrior> between(double before, double now) const;
  double first() const { return poses_.front().timestamp; }  // [s]
  double last() const { return poses_.back().timestamp; }

 private:
  std::optional<Rigid3> at(double time) const;

  Trajectory poses_;
  double drift_;
};

// A trajectory file in TUM format whose relative motion is taken. A first line `# drift D`, 0 ... 1, says how good it
// is; without one it is taken for 1 %. Throws InputError with file and line.
OdometryTrack read_odometry(const std::filesystem::path& path);

// The frames of a source with priors by a track.
std::unique_ptr<Source> with_prior(std::unique_ptr<Source> source, OdometryTrack track);
// The same by a file, see read_odometry(). Throws InputError when the file is of another time than a recording.
std::unique_ptr<Source> with_prior_file(std::unique_ptr<Source> source, const std::filesystem::path& path);

}  // namespace dkb
