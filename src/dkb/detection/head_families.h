// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/detection/detector_heads.h"

namespace dkb {

// The families of heads, for the table of all.
std::vector<DetectorHead> yolo_heads();          // YOLOv5, YOLOX, YOLOv8 and its masks
std::vector<DetectorHead> distribution_heads();  // NanoDet-Plus, PicoDet
std::vector<DetectorHead> detr_heads();          // RF-DETR, D-FINE, RT-DETR

// Whether these are an output's dimensions; -1 stands for any.
bool has_dims(const OnnxNetwork::Output& output, std::initializer_list<int> dims);
// The place of the first output of this name, or of these dimensions.
std::optional<size_t> output_named(NetworkOutputs outputs, const char* name);
std::optional<size_t> output_of_dims(NetworkOutputs outputs, std::initializer_list<int> dims);
// The layout of 1 x N x (others + C): in a row beside the scores of C classes so many other numbers.
std::optional<HeadLayout> rows_of(NetworkOutputs outputs, int predictions, int others);

inline int best_class(const float* scores, int classes) {
  return static_cast<int>(std::max_element(scores, scores + classes) - scores);
}

// Appends a prediction whose numbers are finite and whose box is not empty.
inline void keep(const Prediction& p, std::vector<Prediction>* out) {
  const bool finite = std::isfinite(p.box.x) && std::isfinite(p.box.y) && std::isfinite(p.box.w) &&
                      std::isfinite(p.box.h) && std::isfinite(p.score);
  if (finite && p.box.w > 0 && p.box.h > 0) out->push_back(p);
}

inline Box box_about(float cx, float cy, float w, float h) {
  return {cx - w / 2, cy - h / 2, w, h};
}
inline Box box_between(float left, float top, float right, float bottom) {
  return {left, top, right - left, bottom - top};
}

// [px] from cell to cell of the grids that networks predict on: levels 3 to 6 of a feature pyramid, 2^level (Lin et al.
// 2017). YOLO heads have the first three.
inline constexpr std::array kStrides = {8, 16, 32, 64};

struct Cell {
  float column, row, stride;
};

// The cells of the grids of these strides, each of which covers all of the input: how many, and one after the other by
// stride, row and column.
int cell_count(std::span<const int> strides, int width, int height);
template <class Use>
void each_cell(std::span<const int> strides, int width, int height, const Use& use) {
  for (const int stride : strides)
    for (int row = 0; row * stride < height; ++row)
      for (int column = 0; column * stride < width; ++column)
        use(Cell{static_cast<float>(column), static_cast<float>(row), static_cast<float>(stride)});
}

// Predictions whose scores are stored by channel, C x N, with box_of(i) of each.
template <class BoxOf>
std::vector<Prediction> decode_channels(const HeadLayout& layout, const float* scores, const Wanted& wanted,
                                        const BoxOf& box_of) {
  const auto n = static_cast<size_t>(layout.predictions);
  std::vector<float> best(scores, scores + n);
  std::vector<int> best_class(n, 0);
  for (int c = 1; c < layout.classes; ++c) {
    scores += n;
    for (size_t i = 0; i < n; ++i)
      if (scores[i] > best[i]) {
        best[i] = scores[i];
        best_class[i] = c;
      }
  }
  std::vector<Prediction> out;
  for (size_t i = 0; i < n; ++i)
    if (wanted.takes(best_class[i], best[i])) keep({best_class[i], box_of(i), best[i], i}, &out);
  return out;
}

}  // namespace dkb
