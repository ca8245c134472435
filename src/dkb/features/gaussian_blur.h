// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

inline constexpr int kBlurRadius = 3;  // [px]

// Gaussian of sigma 2 px on 7 x 7 pixels, separable, in 8-bit fixed point, rounded after each direction (columns
// first). The outermost 3 pixels are copied. Buffers are kept between calls.
class GaussianBlur {
 public:
  explicit GaussianBlur(Simd simd = best_simd()) : simd_(simd) {}
  // `blurred` gets the size of `image` and must not be the same object.
  void apply(const GreyImage& image, GreyImage& blurred);

 private:
  Simd simd_;
  std::vector<uint8_t> row_;
};

}  // namespace dkb
