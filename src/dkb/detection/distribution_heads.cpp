// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "dkb/detection/head_families.h"

// Heads of generalised focal loss (Li et al. 2020): each side of a box is told as a distribution over its distance from
// the cell, 0 ... 7 strides, of which the mean counts.
namespace dkb {
namespace {

constexpr int kLevels[] = {8, 16, 32, 64};
constexpr int kBins = 8, kSides = 4 * kBins;

// The grid of a stride covers all of the input.
int columns_of(int width, int stride) {
  return (width + stride - 1) / stride;
}
int cells_of(int width, int height, int stride) {
  return columns_of(width, stride) * columns_of(height, stride);
}
int all_cells(int width, int height) {
  int cells = 0;
  for (const int stride : kLevels) cells += cells_of(width, height, stride);
  return cells;
}

// Mean of the distribution with these logarithms.
float mean_of(const float* logits) {
  const float largest = *std::max_element(logits, logits + kBins);
  float sum = 0, weighted = 0;
  for (int i = 0; i < kBins; ++i) {
    const float p = std::exp(logits[i] - largest);
    sum += p;
    weighted += p * static_cast<float>(i);
  }
  return weighted / sum;
}

// The predictions of one stride's cells: scores and sides of a cell lie `score_step` and `side_step` values after those
// of the one before.
struct Grid {
  const float* scores;
  const float* sides;
  size_t score_step, side_step;
  int stride;
  float centre;  // [cells] of a cell, from its corner
};

void decode_grid(const Grid& grid, int classes, int width, int height, const Wanted& wanted,
                 std::vector<Prediction>* out) {
  const int columns = columns_of(width, grid.stride), cells = cells_of(width, height, grid.stride);
  const float *scores = grid.scores, *sides = grid.sides;
  const auto stride = static_cast<float>(grid.stride);
  for (int i = 0; i < cells; ++i, scores += grid.score_step, sides += grid.side_step) {
    const float* best = std::max_element(scores, scores + classes);
    const int class_id = static_cast<int>(best - scores);
    if (!wanted.takes(class_id, *best)) continue;
    const float x = static_cast<float>(i % columns) + grid.centre, y = static_cast<float>(i / columns) + grid.centre;
    std::array<float, 4> side;  // [strides] left, top, right, bottom
    for (size_t k = 0; k < 4; ++k) side[k] = mean_of(sides + k * kBins);
    keep({class_id,
          box_between((x - side[0]) * stride, (y - side[1]) * stride, (x + side[2]) * stride, (y + side[3]) * stride),
          *best, 0},
         out);
  }
}

// NanoDet-Plus: distances count from a cell's corner.
class NanoDetPlus final : public DetectorHead {
 public:
  NanoDetPlus()
      : DetectorHead({.name = "NanoDet-Plus",
                      .outputs = "1 x N x (C + 32), strides 8 to 64",
                      .preprocessing = stretched_by_imagenet(true),
                      .usual_input = 416}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    const int cells = all_cells(width, height);
    const auto output = output_of_dims(outputs, {1, cells, -1});
    if (!output || outputs[*output].dims[2] <= kSides) return std::nullopt;
    return HeadLayout{this, outputs[*output].dims[2] - kSides, cells, {*output}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                 const Wanted& wanted) const override {
    std::vector<Prediction> out;
    const float* row = outputs[layout.outputs[0]].values.data();
    const size_t step = static_cast<size_t>(layout.classes + kSides);
    for (const int stride : kLevels) {
      decode_grid({row, row + layout.classes, step, step, stride, 0}, layout.classes, width, height, wanted, &out);
      row += step * static_cast<size_t>(cells_of(width, height, stride));
    }
    return out;
  }
};

// PicoDet as exported without what comes after the network: distances count from a cell's centre.
class PicoDet final : public DetectorHead {
 public:
  PicoDet()
      : DetectorHead({.name = "PicoDet",
                      .outputs = "for each stride of 8 to 64 1 x N x C and 1 x N x 32",
                      .preprocessing = stretched_by_imagenet(false),
                      .usual_input = 416}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    HeadLayout layout{this, 0, 0, {}};
    for (const int stride : kLevels) {
      const int cells = cells_of(width, height, stride);
      std::vector<size_t> of_stride;
      for (size_t i = 0; i < outputs.size(); ++i)
        if (has_dims(outputs[i], {1, cells, -1})) of_stride.push_back(i);
      if (of_stride.size() != 2) return std::nullopt;
      // Scores come first; OpenCV gives outputs in an order of its own.
      if (outputs[of_stride[1]].dims[2] != kSides) std::swap(of_stride[0], of_stride[1]);
      const int classes = outputs[of_stride[0]].dims[2];
      if (outputs[of_stride[1]].dims[2] != kSides || classes == 0 || (layout.classes != 0 && layout.classes != classes))
        return std::nullopt;
      layout.classes = classes;
      layout.predictions += cells;
      layout.outputs.insert(layout.outputs.end(), of_stride.begin(), of_stride.end());
    }
    return layout;
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                 const Wanted& wanted) const override {
    std::vector<Prediction> out;
    for (size_t i = 0; i < std::size(kLevels); ++i)
      decode_grid({outputs[layout.outputs[2 * i]].values.data(), outputs[layout.outputs[2 * i + 1]].values.data(),
                   static_cast<size_t>(layout.classes), kSides, kLevels[i], 0.5f},
                  layout.classes, width, height, wanted, &out);
    return out;
  }
};

// PicoDet as exported with its boxes, in pixels of the input, but without suppression.
class PicoDetBoxes final : public DetectorHead {
 public:
  PicoDetBoxes()
      : DetectorHead({.name = "PicoDet without NMS",
                      .outputs = "1 x N x 4 and 1 x C x N, strides 8 to 64",
                      .preprocessing = stretched_by_imagenet(false),
                      .usual_input = 416}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    const int cells = all_cells(width, height);
    const auto boxes = output_of_dims(outputs, {1, cells, 4}), scores = output_of_dims(outputs, {1, -1, cells});
    if (!boxes || !scores || boxes == scores || outputs[*scores].dims[1] == 0) return std::nullopt;
    return HeadLayout{this, outputs[*scores].dims[1], cells, {*boxes, *scores}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                 const Wanted& wanted) const override {
    const float *box = outputs[layout.outputs[0]].values.data(), *scores = outputs[layout.outputs[1]].values.data();
    const auto n = static_cast<size_t>(layout.predictions);
    std::vector<Prediction> out;
    for (size_t i = 0; i < n; ++i, box += 4) {
      int best = 0;
      for (int c = 1; c < layout.classes; ++c)
        if (scores[static_cast<size_t>(c) * n + i] > scores[static_cast<size_t>(best) * n + i]) best = c;
      const float score = scores[static_cast<size_t>(best) * n + i];
      if (wanted.takes(best, score)) keep({best, box_between(box[0], box[1], box[2], box[3]), score, i}, &out);
    }
    return out;
  }
};

}  // namespace

std::vector<const DetectorHead*> distribution_heads() {
  static const NanoDetPlus nanodet;
  static const PicoDet picodet;
  static const PicoDetBoxes picodet_boxes;
  return {&nanodet, &picodet, &picodet_boxes};
}

}  // namespace dkb
