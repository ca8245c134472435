// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"

namespace dkb {

// Families of detection networks by the layout of their output. All predict on grids of strides 8, 16 and 32.
//   v5:    1 x N x (5 + C), N = 3 anchors x cells: cx cy w h [px of the input], objectness, C class scores. RGB 0
//   ... 1. yolox: 1 x N x (5 + C), N = cells: offsets in the cell and logarithms of the size, in strides. BGR 0 ...
//   255. v8:    1 x (4 + C) x N, N = cells: cx cy w h [px of the input], C class scores. RGB 0 ... 1. Also v9, v11.
enum class YoloHead { v5, yolox, v8 };
const char* to_string(YoloHead head);

struct HeadLayout {
  YoloHead kind = YoloHead::v5;
  int classes = 0;      // C
  int predictions = 0;  // N
  bool operator==(const HeadLayout&) const = default;
};

// The head whose output has these dimensions at this input size [px, multiples of 32]; none when no known one does.
// Where N equals the other dimension (84 x 84: 80 classes at 64 x 64 px) YOLOX is assumed.
std::optional<HeadLayout> recognise_head(std::span<const int> dims, int input_width, int input_height);

// How an image lies in a network's input: scaled by `scale` keeping its aspect, padded with grey 114.
struct Letterbox {
  int input_width = 0, input_height = 0;    // [px]
  int image_width = 0, image_height = 0;    // [px]
  int scaled_width = 0, scaled_height = 0;  // [px] of the input that the image covers
  int left = 0, top = 0;                    // [px] of padding before it

  // v5 and v8 put the image in the middle, YOLOX to the top left, as each was trained.
  static Letterbox fit(YoloHead head, int image_width, int image_height, int input_width, int input_height);

  Box to_image(const Box& in_input) const;
  Box to_input(const Box& in_image) const;
};

// The network's input, 3 x input_height x input_width floats in the head's channel order and range: bilinear, pixel
// centres at half coordinates. Grey images feed all three channels. `blob` is resized.
void fill_blob(const DetectorInput& image, const Letterbox& letterbox, YoloHead head, std::vector<float>* blob);

// A decoded prediction: best class, box in pixels of the network's input.
struct Prediction {
  int class_id = 0;
  Box box;
  float score = 0;
};

// Predictions whose best class is movable and scores at least `min_score`, in the output's order; values that are not
// finite are left out. `output` holds the head's layout.predictions x ... floats.
std::vector<Prediction> decode(const HeadLayout& layout, std::span<const float> output, int input_width,
                               int input_height, const std::vector<bool>& movable, float min_score);

// Greedy non-maximum suppression within each class: by falling score (ties in the given order) a box stays unless it
// overlaps one that stayed by more than `max_overlap` (intersection over union). The best 1000 take part.
std::vector<Prediction> suppress_overlaps(std::vector<Prediction> predictions, float max_overlap);

}  // namespace dkb
