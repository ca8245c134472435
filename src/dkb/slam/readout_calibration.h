// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dkb/matching/optics.h"
#include "dkb/tracking/frame.h"

namespace dkb {

// Learns how long a rolling shutter takes from the first row to the last, while the camera is in use. Rows that are
// exposed early or late show their points off by the image's motion times the row's delay; what a pose cannot explain
// of that pattern tells the delay. Recursive least squares with the pose of each frame eliminated. The map was made
// from the same sheared images, so that each frame tells less than all that is missing; the next ones make up for it.
// Deterministic.
class ReadoutCalibration {
 public:
  // `estimate`: when the camera's file does not tell the readout.
  ReadoutCalibration(const Optics& optics, bool estimate);

  // [s] to be used for the next frame; the camera file's own where it has one.
  double readout() const { return readout_; }
  bool known() const { return known_; }
  // A tracked frame, whose features were made with readout(), the camera's motion then [m/s, rad/s], and where in the
  // world the map points are that its features show [m].
  void add(const TrackedFrame& frame, const Vector6d& velocity,
           const std::vector<std::optional<Eigen::Vector3d>>& positions);

 private:
  Optics optics_;
  bool known_;
  double max_readout_;  // [s]
  double readout_;      // [s]
  double information_;  // [1/s^2] of the readout
};

}  // namespace dkb
