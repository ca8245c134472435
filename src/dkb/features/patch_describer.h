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
  // `pyramid` is that of the image. Both must outlive it, and the pyramid must not be built anew before.
  PatchDescriber(const ImagePyramid& pyramid, const SteeredBrief& brief) : pyramid_(pyramid), brief_(brief) {}

  // Least Hamming distance [bits] between `sought` and the descriptors at (x, y) [px of the image] and the 8 pixels
  // around it on pyramid level `octave`; nothing where that reaches beyond the image.
  std::optional<int> distance(float x, float y, int octave, const Descriptor& sought);

 private:
  const GreyImage& blurred(int level);

  const ImagePyramid& pyramid_;
  const SteeredBrief& brief_;
  GaussianBlur blur_;
  std::vector<GreyImage> blurred_;  // per level; empty until asked for
};

}  // namespace dkb
