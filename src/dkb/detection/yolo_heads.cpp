// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "dkb/detection/head_families.h"

namespace dkb {
namespace {

constexpr int kStrides[] = {8, 16, 32};
constexpr int kMaskCoefficients = 32;

// Of the grids of all strides; 0 where they do not fill the input.
int cell_count(int width, int height) {
  int cells = 0;
  if (width % kStrides[2] == 0 && height % kStrides[2] == 0)
    for (const int stride : kStrides) cells += (width / stride) * (height / stride);
  return cells;
}

// Calls use(i, row, class, score) for each of the rows first ... first + count, cx cy w h objectness classes..., that
// is wanted.
template <class Use>
void each_objectness_row(const HeadLayout& layout, const float* row, size_t first, size_t count, const Wanted& wanted,
                         const Use& use) {
  const size_t width = 5 + static_cast<size_t>(layout.classes);
  row += first * width;
  for (size_t i = 0; i < count; ++i, row += width) {
    if (!(row[4] >= wanted.min_score)) continue;  // scores are at most 1
    const float* best = std::max_element(row + 5, row + width);
    const int class_id = static_cast<int>(best - (row + 5));
    const float score = row[4] * *best;
    if (wanted.takes(class_id, score)) use(i, row, class_id, score);
  }
}

// Ultralytics' YOLOv5, and YOLOv7: three anchors a cell, pixels of the input.
class YoloV5 final : public DetectorHead {
 public:
  YoloV5() : DetectorHead({.name = "YOLOv5", .outputs = "1 x N x (5 + C), N = 3 boxes a cell", .preprocessing = {}}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    const int boxes = 3 * cell_count(width, height);
    const auto output = output_of_dims(outputs, {1, boxes, -1});
    if (boxes == 0 || !output || outputs[*output].dims[2] <= 5) return std::nullopt;
    return HeadLayout{this, outputs[*output].dims[2] - 5, boxes, {*output}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                 const Wanted& wanted) const override {
    std::vector<Prediction> out;
    each_objectness_row(layout, outputs[layout.outputs[0]].values.data(), 0, static_cast<size_t>(layout.predictions),
                        wanted, [&](size_t i, const float* v, int c, float score) {
                          keep({c, box_about(v[0], v[1], v[2], v[3]), score, i}, &out);
                        });
    return out;
  }
};

// YOLOX (Ge et al. 2021): a box a cell; centre = (offset + cell) * stride, size = exp(value) * stride.
class YoloX final : public DetectorHead {
 public:
  YoloX()
      : DetectorHead({.name = "YOLOX",
                      .outputs = "1 x N x (5 + C), N = 1 box a cell",
                      .preprocessing = {.fit = Preprocessing::Fit::corner, .blue_first = true, .scale = {1, 1, 1}},
                      .usual_input = 416}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    const int cells = cell_count(width, height);
    const auto output = output_of_dims(outputs, {1, cells, -1});
    if (cells == 0 || !output || outputs[*output].dims[2] <= 5) return std::nullopt;
    return HeadLayout{this, outputs[*output].dims[2] - 5, cells, {*output}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                 const Wanted& wanted) const override {
    std::vector<Prediction> out;
    size_t first = 0;
    for (const int stride : kStrides) {
      const auto columns = static_cast<size_t>(width / stride);
      const size_t cells = columns * static_cast<size_t>(height / stride);
      const auto s = static_cast<float>(stride);
      each_objectness_row(layout, outputs[layout.outputs[0]].values.data(), first, cells, wanted,
                          [&](size_t cell, const float* v, int c, float score) {
                            const auto x = static_cast<float>(cell % columns), y = static_cast<float>(cell / columns);
                            const Box box =
                                box_about((v[0] + x) * s, (v[1] + y) * s, std::exp(v[2]) * s, std::exp(v[3]) * s);
                            keep({c, box, score, first + cell}, &out);
                          });
      first += cells;
    }
    return out;
  }
};

// YOLOv8, v9 and v11: no objectness, pixels of the input, stored by channel.
class YoloV8 : public DetectorHead {
 public:
  YoloV8() : YoloV8({.name = "YOLOv8", .outputs = "1 x (4 + C) x N", .preprocessing = {}}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    const int cells = cell_count(width, height);
    const auto output = output_of_dims(outputs, {1, -1, cells});
    if (cells == 0 || !output || outputs[*output].dims[1] <= 4) return std::nullopt;
    return HeadLayout{this, outputs[*output].dims[1] - 4, cells, {*output}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                 const Wanted& wanted) const override {
    const float* output = outputs[layout.outputs[0]].values.data();
    const auto n = static_cast<size_t>(layout.predictions);
    std::vector<float> best(output + 4 * n, output + 5 * n);
    std::vector<int> best_class(n, 0);
    for (int c = 1; c < layout.classes; ++c) {
      const float* scores = output + (4 + static_cast<size_t>(c)) * n;
      for (size_t i = 0; i < n; ++i)
        if (scores[i] > best[i]) {
          best[i] = scores[i];
          best_class[i] = c;
        }
    }
    std::vector<Prediction> out;
    for (size_t i = 0; i < n; ++i)
      if (wanted.takes(best_class[i], best[i]))
        keep({best_class[i], box_about(output[i], output[n + i], output[2 * n + i], output[3 * n + i]), best[i], i},
             &out);
    return out;
  }

 protected:
  explicit YoloV8(const Facts& its_facts) : DetectorHead(its_facts) {}
};

// The same with masks, a quarter of the input's size: the sum of prototypes, each by the prediction's coefficient.
class YoloV8Seg final : public YoloV8 {
 public:
  YoloV8Seg()
      : YoloV8({.name = "YOLOv8-seg",
                .outputs = "1 x (4 + C + 32) x N and 1 x 32 x H/4 x W/4",
                .preprocessing = {},
                .masks = true}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    auto layout = YoloV8::recognise(outputs, width, height);
    const auto prototypes = output_of_dims(outputs, {1, kMaskCoefficients, height / 4, width / 4});
    if (!layout || !prototypes || layout->classes <= kMaskCoefficients) return std::nullopt;
    layout->classes -= kMaskCoefficients;
    layout->outputs.push_back(*prototypes);
    return layout;
  }
  MaskLogits mask(const HeadLayout& layout, NetworkOutputs outputs, const Prediction& prediction) const override {
    const OnnxNetwork::Output& prototypes = outputs[layout.outputs[1]];
    MaskLogits mask{prototypes.dims[3], prototypes.dims[2], {}};
    mask.values.resize(static_cast<size_t>(mask.width) * static_cast<size_t>(mask.height));
    const float* prototype = prototypes.values.data();
    const float* coefficient = outputs[layout.outputs[0]].values.data() + prediction.index +
                               (4 + static_cast<size_t>(layout.classes)) * static_cast<size_t>(layout.predictions);
    for (int k = 0; k < kMaskCoefficients; ++k, coefficient += layout.predictions)
      for (float& value : mask.values) value += *coefficient * *prototype++;
    return mask;
  }
};

}  // namespace

std::vector<const DetectorHead*> yolo_heads() {
  static const YoloV5 v5;
  static const YoloX yolox;
  static const YoloV8Seg v8_seg;
  static const YoloV8 v8;
  return {&v5, &yolox, &v8_seg, &v8};  // where N is also the other dimension YOLOX comes before YOLOv8
}

}  // namespace dkb
