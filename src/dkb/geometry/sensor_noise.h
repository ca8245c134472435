// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "dkb/util/errors.h"

namespace dkb {

// How far corners and depths may be off.
struct SensorNoise {
  static constexpr int kMaxLevels = 32;  // of an image pyramid

  // [px] of a corner on the finest pyramid level, > 0, for a camera of the usual focal length: what corners are off by
  // is the lens, blur and the shutter's, which are angles.
  double pixel_sigma = 1.0;
  double depth_sigma_base = 0.0012;  // [m] at 0.4 m, > 0        (Nguyen, Izadi, Lovell 2012, axial noise of the Kinect)
  double depth_sigma_quadratic = 0.0019;  // [1/m] growth with (z - 0.4 m)^2, >= 0   (the same source)
  double depth_sigma_factor =
      10.0;  // what edges, registration and calibration add to the source's flat-wall figure, >= 1

  // Standard deviation [px, full resolution, usual focal length] of a corner found on a pyramid level: as the root of
  // the level's scale.
  double corner_sigma(int octave, double scale_factor) const {
    return pixel_sigma * std::pow(scale_factor, 0.5 * octave);
  }
  // Standard deviation [m] of a depth z [m] on a flat wall (the source), and at a corner.
  double flat_depth_sigma(double z) const { return depth_sigma_base + depth_sigma_quadratic * (z - 0.4) * (z - 0.4); }
  double depth_sigma(double z) const { return depth_sigma_factor * flat_depth_sigma(z); }

  // What two depths of one place, measured at different times around z [m], may differ by [m]. The sensor's part: a
  // difference of two has sqrt(2) sigmas, of which 4.24 are exceeded by one in 45,000, less than once in an image of
  // 160 x 120 cells. To it comes what the poses of both and the calibration may be off.
  double surface_tolerance(double z) const {
    constexpr double kPoseError = 0.02;  // [m]
    return kPoseError + 6 * flat_depth_sigma(z);
  }
  // Whether two depths [m] of one place, measured at different times, may be of one surface.
  bool same_surface(double z1, double z2) const { return std::abs(z1 - z2) <= surface_tolerance(std::max(z1, z2)); }
  // What the depth of a corner may differ by from that of the map point which it shows [m]: three standard deviations.
  double point_tolerance(double z) const { return 3 * depth_sigma(z); }
  // The largest step [m] between depths around z that lie `pixels` apart on one surface. A surface that is seen at 75
  // degrees from its normal, beyond which a structured-light sensor sees little of it, falls away by tan 75 of the
  // distance across. To it comes the difference of two depths, exceeded by one in twenty.
  double max_depth_jump(double z, double pixels, double focal) const {
    constexpr double kSteepest = 3.73;    // tan 75 degrees
    constexpr double kDifference = 2.77;  // 1.96 sqrt(2)
    return kDifference * flat_depth_sigma(z) + kSteepest * pixels / focal * z;
  }
};

}  // namespace dkb
