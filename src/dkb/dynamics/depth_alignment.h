// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb/dynamics/motion_depth_grid.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb_slam/frame.h"

namespace dkb {

// Where a depth image was taken, by the surfaces that an earlier one saw: point-to-plane distances with projective
// association (Blais and Levine, PAMI 1995; Chen and Medioni, IVC 1992) under a robust cost (Tukey's), beside what was
// expected. What the surfaces leave open stays as it was expected. Deterministic.
//
// Rows of a depth image may be read one after the other (a Kinect's are), or all at once. What no motion between two
// images explains of the rows' shear tells how long that takes: recursive least squares with each step eliminated.
class DepthAlignment {
 public:
  DepthAlignment(const SensorNoise& noise, double focal, const MotionRays& rays);

  // The motion between the two grids' cameras, from `there` to `here`, with its covariance: what was expected and what
  // the surfaces say, each weighed by its own. Cells of `there` whose score says that they move are left out. Nothing
  // when too few surfaces are in both.
  // Rows are held against each other by the velocity of `there` and, as that of `here`, by the step itself.
  std::optional<MotionPrior> align(const MotionDepthGrid& here, const MotionDepthGrid& there, const MotionRays& rays,
                                   const MotionPrior& expected);
  // [s] from the first row of a depth image to the last, as far as the images so far tell; 0 before any.
  double readout() const { return readout_; }

 private:
  Eigen::Vector3f find_normal(const MotionDepthGrid& grid, const MotionRays& rays, int x, int y,
                              const ReadoutMotion& readout) const;

  SensorNoise noise_;
  double focal_;                    // [px]
  Image<Eigen::Vector3f> normals_;  // of the cells of `there` that were asked for; zero where there is none
  Image<uint8_t> asked_;            // 1 where it was
  // How much more the cells of a block vary together than by the sensor's noise: so far, once it is known.
  std::optional<double> together_;
  double readout_ = 0;          // [s]
  double readout_information_;  // [1/s^2]
};

}  // namespace dkb
