// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/features/patch_describer.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/image.h"

namespace dkb {

// How a map point looks in an image where it ought to be.
enum class Look : uint8_t {
  unknown,  // hidden or gone, without depth, or neither alike nor unlike
  same,
  other,  // a surface is there, and looks different
};

// How a place of an image looks compared with a map point that ought to be there.
class PointAppearance {
 public:
  virtual ~PointAppearance() = default;
  // `pixel` [px] is ideal, `depth` [m] the point's; `octave` is the pyramid level.
  virtual Look look(const Eigen::Vector2d& pixel, double depth, int octave, const Descriptor& descriptor) = 0;
};

// By what a descriptor differs from the image where it should be found. Does nothing until it is asked.
class ImageAppearance final : public PointAppearance {
 public:
  // Of an image by its depth and what the extractor made its features with. All but the noise must outlive it, and the
  // pyramid must not be built anew before.
  ImageAppearance(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                  const ImagePyramid& pyramid, const SteeredBrief& brief)
      : depth_(depth), camera_(camera), noise_(noise), describer_(pyramid, brief) {}
  Look look(const Eigen::Vector2d& pixel, double depth, int octave, const Descriptor& descriptor) override;

 private:
  const DepthImage& depth_;
  const CameraModel& camera_;
  SensorNoise noise_;
  PatchDescriber describer_;
};

}  // namespace dkb
