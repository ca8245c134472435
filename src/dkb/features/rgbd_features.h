// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/keypoint_grid.h"
#include "dkb/features/simd.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

struct Keypoint {
  Eigen::Vector2f pixel;        // [px] ideal (undistorted)
  Eigen::Vector2f image_pixel;  // [px] where it lies in the image as read
  float depth = 0;              // [m] along the optical axis at the colour image's time, 0 = unknown
  float lent_depth = 0;         // [m] of the nearest surface around one of unknown depth, 0 = none
  float angle = 0;              // [rad]
  float response = 0;
  float place_sigma = 0;  // [px] see Corner
  uint8_t octave = 0;
  Rgb colour;
};

// All that is kept of an image: corners with depth and descriptors. Immutable once made, shared between threads.
struct RgbdFeatures {
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;  // same length
  KeypointGrid grid;                    // over the ideal pixels
  size_t size() const { return keypoints.size(); }
};

// Whether a corner may show what lies `z` [m] before the camera: the surface whose depth it has or, where it has none
// of its own, nothing nearer than the surfaces around it. `tolerance` times what the noise lets depths differ by is
// allowed.
inline bool may_show(const Keypoint& keypoint, double z, const SensorNoise& noise, double tolerance = 1) {
  if (keypoint.depth > 0) return std::abs(z - keypoint.depth) < tolerance * noise.point_tolerance(keypoint.depth);
  const double nearest = keypoint.lent_depth;  // zero where nothing is known
  return z >= nearest || nearest - z < tolerance * noise.point_tolerance(nearest);
}

struct DepthOptions {
  bool model_time_offset = true;      // move depths to the colour image's time with the camera's motion
  bool model_rolling_shutter = true;  // move features to where they would lie had the whole image been exposed at once
};

// Ideal-pixel lookup for every image pixel of a distorted camera, tabulated once (bilinear between nodes 8 px apart).
class UndistortionTable {
 public:
  explicit UndistortionTable(const CameraModel& camera);
  Eigen::Vector2f operator()(float x, float y) const;

 private:
  int columns_ = 0, rows_ = 0;
  bool identity_ = true;
  std::vector<Eigen::Vector2f> offset_;  // ideal minus image pixel, per node
};

// Reads the depth of corners. A corner beside a depth step has no depth of its own: the step lies a pixel or two from
// where the image shows it, so that half of the corners on a plant had the depth of the wall behind. The nearer surface
// lends it one, since the outline that made the corner is most likely its own.
class CornerDepths {
 public:
  // `depth` must outlive it.
  CornerDepths(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise, Simd simd = best_simd())
      : depth_(depth), focal_(camera.fx), noise_(noise), simd_(simd) {}

  struct Depth {
    float own = 0, lent = 0;                           // [m] one of the two at most
    Eigen::Vector2i lender = Eigen::Vector2i::Zero();  // [px] where it was lent from
  };
  Depth at(float x, float y) const;

  // [px] FAST looks at a circle of 3, and the outlines of a structured-light sensor wander by about one.
  static constexpr int kReach = 4;

 private:
  float nearest_around(int cx, int cy) const;
  Depth nearest_pixel(int cx, int cy, float limit) const;

  const DepthImage& depth_;
  const double focal_;
  const SensorNoise noise_;
  const Simd simd_;
};

// Corners with depth and colour, as a camera that stands still has them.
std::vector<Keypoint> keypoints_as_seen(const OrbFeatures& orb, const RgbdImage& image,
                                        const UndistortionTable& undistort, const CameraModel& camera,
                                        const SensorNoise& noise);
// Features of a camera that moves at `velocity` [m/s, rad/s; zero when unknown], from keypoints as seen and as many
// descriptors: hand-held Kinects move millimetres between the stamps of colour and depth.
RgbdFeatures make_rgbd_features(std::vector<Descriptor> descriptors, std::vector<Keypoint> as_seen,
                                const RgbdImage& image, const CameraModel& camera, const SensorNoise& noise,
                                const Vector6d& velocity, const DepthOptions& options);

// The features of these indices, in this order, with a grid of their own.
RgbdFeatures subset(const RgbdFeatures& features, const std::vector<int>& indices);

}  // namespace dkb
