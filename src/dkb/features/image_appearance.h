// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb/features/patch_describer.h"
#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/sensor_noise.h"

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
  // The image and the camera must outlive it.
  ImageAppearance(const RgbdImage& image, const CameraModel& camera, const SensorNoise& noise,
                  const ImagePyramidOptions& pyramid)
      : image_(image), camera_(camera), noise_(noise), pyramid_(pyramid) {}
  Look look(const Eigen::Vector2d& pixel, double depth, int octave, const Descriptor& descriptor) override;

 private:
  const RgbdImage& image_;
  const CameraModel& camera_;
  SensorNoise noise_;
  ImagePyramidOptions pyramid_;
  std::optional<PatchDescriber> describer_;  // of the image, once it was asked for
};

}  // namespace dkb
