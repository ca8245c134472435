// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb/features/patch_describer.h"
#include "dkb/features/rgbd_features.h"

namespace dkb {

// How a place of an image looks compared with a map point that ought to be there.
class PointAppearance {
 public:
  virtual ~PointAppearance() = default;
  // Whether it looks the same; nothing where that cannot be told. `pixel` [px] is ideal, `depth` [m] the point's;
  // `octave` is the pyramid level.
  virtual std::optional<bool> same(const Eigen::Vector2d& pixel, double depth, int octave,
                                   const Descriptor& descriptor) = 0;
};

// By what a descriptor differs from the image where it should be found. Does nothing until it is asked.
class ImageAppearance final : public PointAppearance {
 public:
  // The image and the table must outlive it.
  ImageAppearance(const RgbdImage& image, const UndistortionTable& undistort, const ImagePyramidOptions& pyramid)
      : image_(image), undistort_(undistort), pyramid_(pyramid) {}
  std::optional<bool> same(const Eigen::Vector2d& pixel, double depth, int octave,
                           const Descriptor& descriptor) override;

 private:
  const RgbdImage& image_;
  const UndistortionTable& undistort_;
  ImagePyramidOptions pyramid_;
  std::optional<PatchDescriber> describer_;  // of the image, once it was asked for
};

}  // namespace dkb
