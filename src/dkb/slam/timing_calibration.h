// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dkb/image/image.h"
#include "dkb/matching/optics.h"
#include "dkb/tracking/frame.h"

namespace dkb {

// Learns when the camera sees what its images show, while it is in use: how long a rolling shutter takes from the
// first row to the last (or, below 0, from the last to the first: images turned upside down), and how long after its
// stamp, or before, a depth image shows what the colour camera saw. Rows that are exposed early or late show their
// points off by the image's motion times the delay, and depths of another time are off by how fast the surface in
// that pixel comes nearer; what a pose cannot explain of these patterns tells the delay. Recursive least squares
// with the pose of each frame eliminated. The map was made from the same images, so that each frame tells less than
// all that is missing; the next ones make up for it. Deterministic.
class TimingCalibration {
 public:
  // What is to be learnt where the camera's file does not tell it (0).
  TimingCalibration(const Optics& optics, bool learn_readout, bool learn_depth_offset);

  // With readout and depth_time_offset to be used for the next frame.
  const Camera& camera() const { return optics_.camera; }
  // Whether there is nothing to be learnt.
  bool known() const { return readout_.known && depth_offset_.known; }
  // A tracked frame, whose features were made with camera(), its depth image, the camera's motion then [m/s, rad/s],
  // and where in the world the map points are that its features show [m].
  void add(const TrackedFrame& frame, const DepthImage& depth, const Vector6d& velocity,
           const std::vector<std::optional<Eigen::Vector3d>>& positions);

 private:
  struct Delay {  // its value is the camera's
    bool known;
    double smallest, largest;  // [s] that are believed in
    double information;        // [1/s^2]
  };

  Optics optics_;
  Delay readout_, depth_offset_;
};

}  // namespace dkb
