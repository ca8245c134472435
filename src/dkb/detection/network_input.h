// SPDX-License-Identifier: Apache-2.0
#pragma once

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

// Mean and deviation of ImageNet's colours, which many networks are trained with.
Preprocessing stretched_by_imagenet(bool blue_first);

// Where an image lies in a network's input.
struct Letterbox {
  int input_width = 0, input_height = 0;    // [px]
  int image_width = 0, image_height = 0;    // [px]
  int scaled_width = 0, scaled_height = 0;  // [px] of the input that the image covers
  int left = 0, top = 0;                    // [px] of padding before it

  static Letterbox place(Preprocessing::Fit fit, int image_width, int image_height, int input_width, int input_height);

  Box to_image(const Box& in_input) const;
  Box to_input(const Box& in_image) const;
};

// The network's input, 3 x input_height x input_width floats: bilinear, pixel centres at half coordinates. Grey images
// feed all three channels. `blob` is resized.
void fill_blob(const DetectorInput& image, const Letterbox& letterbox, const Preprocessing& preprocessing,
               std::vector<float>* blob, Simd simd = best_simd());

}  // namespace dkb
