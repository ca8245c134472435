// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/features/simd.h"

namespace dkb {

// What a network wants to be given: how an image lies in its input, and the numbers that its pixels become.
struct Preprocessing {
  enum class Fit {
    centred,  // its aspect kept, in the middle of padding of grey 114
    corner,   // its aspect kept, at the top left
    stretched
  };
  Fit fit = Fit::centred;
  bool blue_first = false;
  // Of red, green and blue: value = (level - mean) * scale, for levels of 0 ... 255.
  std::array<float, 3> mean{};
  std::array<float, 3> scale{1.0f / 255.0f, 1.0f / 255.0f, 1.0f / 255.0f};
};

// Mean and deviation of ImageNet's colours as torchvision gives them, times 255: many networks are trained with these.
Preprocessing stretched_by_imagenet(bool blue_first);

// Where an image lies in a network's input.
struct Letterbox {
  int input_width = 0, input_height = 0;    // [px]
  int image_width = 0, image_height = 0;    // [px]
  int scaled_width = 0, scaled_height = 0;  // [px] of the input that the image covers
  int left = 0, top = 0;                    // [px] of padding before it

  static Letterbox place(Preprocessing::Fit fit, int image_width, int image_height, int input_width, int input_height);

  Box to_image(const Box& in_input) const;
};

// A bilinear look-up in a row of values: two places in it, and the weight of the second.
struct Tap {
  int first, second;
  float weight;
};
// `at`: from the row's beginning, in values, whose centres lie at halves; beyond the outermost centres a value lasts.
inline Tap bilinear_tap(float at, int size) {
  at = std::clamp(at - 0.5f, 0.0f, static_cast<float>(size - 1));
  const int first = static_cast<int>(at);
  return {first, std::min(first + 1, size - 1), at - static_cast<float>(first)};
}

// The network's input, 3 x input_height x input_width floats: bilinear, pixel centres at half coordinates. Grey images
// feed all three channels. `blob` is resized.
void fill_blob(const DetectorInput& image, const Letterbox& letterbox, const Preprocessing& preprocessing,
               std::vector<float>* blob, Simd simd = best_simd());

}  // namespace dkb
