// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/gaussian_blur.h"
#include "dkb/features/image_pyramid.h"
#include "dkb/features/steered_brief.h"

namespace dkb {

// Tells how an image looks at places where no corner was found, in the extractor's own descriptors. Deterministic.
class PatchDescriber {
 public:
  explicit PatchDescriber(const ImagePyramidOptions& options) : pyramid_(options) {}

  // Throws InputError for an empty image.
  void set_image(const GreyImage& image);

  // Least Hamming distance [bits] between `sought` and the descriptors at (x, y) [px of the image] and the 8 pixels
  // around it on pyramid level `octave`; nothing where that reaches beyond the image.
  std::optional<int> distance(float x, float y, int octave, const Descriptor& sought) const;

 private:
  ImagePyramid pyramid_;
  GaussianBlur blur_;
  SteeredBrief brief_;
  std::vector<GreyImage> blurred_;  // per level
};

}  // namespace dkb
