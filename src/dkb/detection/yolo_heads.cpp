// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/head_families.h"

namespace dkb {
namespace {

constexpr std::span<const int> kYoloStrides{kStrides.data(), 3};
constexpr int kMaskCoefficients = 32;  // prototypes of Ultralytics' Segment layer

// 0 where the grids do not fill the input.
int yolo_cells(int width, int height) {
  const int largest = kYoloStrides.back();
  return width % largest == 0 && height % largest == 0 ? cell_count(kYoloStrides, width, height) : 0;
}

template <int kBoxesACell>
std::optional<HeadLayout> recognise_rows(NetworkOutputs outputs, int width, int height) {
  return rows_of(outputs, kBoxesACell * yolo_cells(width, height), 5);
}

// Appends the prediction of a row cx cy w h objectness classes..., where it is wanted, with the box that box_of()
// gives.
template <class BoxOf>
void keep_row(const HeadLayout& layout, const float* row, const Wanted& wanted, std::vector<Prediction>* out,
              const BoxOf& box_of) {
  if (!(row[4] >= wanted.min_score)) return;  // class scores are at most 1
  const int class_id = best_class(row + 5, layout.classes);
  const float score = row[4] * row[5 + class_id];
  if (wanted.takes(class_id, score)) keep({class_id, box_of(), score}, out);
}

std::vector<Prediction> decode_v5(const HeadLayout& layout, NetworkOutputs outputs, int, int, const Wanted& wanted) {
  const float* v = outputs[layout.outputs[0]].values.data();
  std::vector<Prediction> out;
  for (int i = 0; i < layout.predictions; ++i, v += 5 + layout.classes)
    keep_row(layout, v, wanted, &out, [&] { return box_about(v[0], v[1], v[2], v[3]); });
  return out;
}

std::vector<Prediction> decode_yolox(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                     const Wanted& wanted) {
  const float* v = outputs[layout.outputs[0]].values.data();
  std::vector<Prediction> out;
  each_cell(kYoloStrides, width, height, [&](const Cell& cell) {
    const float s = cell.stride;
    keep_row(layout, v, wanted, &out, [&] {
      return box_about((v[0] + cell.column) * s, (v[1] + cell.row) * s, std::exp(v[2]) * s, std::exp(v[3]) * s);
    });
    v += 5 + layout.classes;
  });
  return out;
}

std::optional<HeadLayout> recognise_v8(NetworkOutputs outputs, int width, int height) {
  const int cells = yolo_cells(width, height);
  const auto output = output_of_dims(outputs, {1, -1, cells});
  if (cells == 0 || !output || outputs[*output].dims[1] <= 4) return std::nullopt;
  return HeadLayout{nullptr, outputs[*output].dims[1] - 4, cells, {*output}};
}

std::vector<Prediction> decode_v8(const HeadLayout& layout, NetworkOutputs outputs, int, int, const Wanted& wanted) {
  const float* v = outputs[layout.outputs[0]].values.data();
  const auto n = static_cast<size_t>(layout.predictions);
  return decode_channels(layout, v + 4 * n, wanted,
                         [&](size_t i) { return box_about(v[i], v[n + i], v[2 * n + i], v[3 * n + i]); });
}

std::optional<HeadLayout> recognise_v8_seg(NetworkOutputs outputs, int width, int height) {
  auto layout = recognise_v8(outputs, width, height);
  const auto prototypes = output_of_dims(outputs, {1, kMaskCoefficients, height / 4, width / 4});
  if (!layout || !prototypes || layout->classes <= kMaskCoefficients) return std::nullopt;
  layout->classes -= kMaskCoefficients;
  layout->outputs.push_back(*prototypes);
  return layout;
}

// The sum of prototypes, each by the prediction's coefficient.
MaskLogits mask_v8(const HeadLayout& layout, NetworkOutputs outputs, const Prediction& prediction) {
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

}  // namespace

std::vector<DetectorHead> yolo_heads() {
  return {
      // Ultralytics' YOLOv5, and YOLOv7: three anchors a cell, pixels of the input.
      {.name = "YOLOv5",
       .outputs = "1 x N x (5 + C), N = 3 boxes a cell",
       .recognise = recognise_rows<3>,
       .decode = decode_v5},
      // Ge et al. 2021: centre = (offset + cell) * stride, size = exp(value) * stride. Before YOLOv8, for where N is
      // also the other dimension.
      {.name = "YOLOX",
       .outputs = "1 x N x (5 + C), N = 1 box a cell",
       .preprocessing = {.fit = Preprocessing::Fit::corner, .blue_first = true, .scale = {1, 1, 1}},
       .usual_input = 416,
       .recognise = recognise_rows<1>,
       .decode = decode_yolox},
      // The next with masks, a quarter of the input's size.
      {.name = "YOLOv8-seg",
       .outputs = "1 x (4 + C + 32) x N and 1 x 32 x H/4 x W/4",
       .recognise = recognise_v8_seg,
       .decode = decode_v8,
       .mask = mask_v8},
      // YOLOv8, v9 and v11: no objectness, pixels of the input, stored by channel.
      {.name = "YOLOv8", .outputs = "1 x (4 + C) x N", .recognise = recognise_v8, .decode = decode_v8},
  };
}

}  // namespace dkb
