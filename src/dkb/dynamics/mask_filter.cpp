// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mask_filter.h"

namespace dkb {

std::vector<uint8_t> mask_filter(std::span<const FilterFeature> features, const MoverMask& mask) {
  std::vector<uint8_t> dynamic(features.size(), 0);
  for (size_t i = 0; i < features.size(); ++i)
    dynamic[i] =
        mask.at(static_cast<float>(features[i].image_pixel.x()), static_cast<float>(features[i].image_pixel.y()));
  return dynamic;
}

}  // namespace dkb
