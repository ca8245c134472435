// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/head_families.h"

// Heads of generalised focal loss (Li et al. 2020): each side of a box is told as a distribution over its distance from
// the cell, 0 ... 7 strides, of which the mean counts.
namespace dkb {
namespace {

constexpr int kBins = 8, kSides = 4 * kBins;  // reg_max = 7 in the configurations of NanoDet-Plus and PicoDet

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

// Appends a cell's prediction, where it is wanted. Distances count from `centre` [cells] from the cell's corner.
void keep_cell(const HeadLayout& layout, const float* scores, const float* sides, const Cell& cell, float centre,
               const Wanted& wanted, std::vector<Prediction>* out) {
  const int class_id = best_class(scores, layout.classes);
  if (!wanted.takes(class_id, scores[class_id])) return;
  const float x = cell.column + centre, y = cell.row + centre, stride = cell.stride;
  std::array<float, 4> side;  // [strides] left, top, right, bottom
  for (size_t k = 0; k < 4; ++k) side[k] = mean_of(sides + k * kBins);
  const Box box =
      box_between((x - side[0]) * stride, (y - side[1]) * stride, (x + side[2]) * stride, (y + side[3]) * stride);
  keep({class_id, box, scores[class_id]}, out);
}

std::optional<HeadLayout> recognise_nanodet_plus(NetworkOutputs outputs, int width, int height) {
  return rows_of(outputs, cell_count(kStrides, width, height), kSides);
}

std::vector<Prediction> decode_nanodet_plus(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                            const Wanted& wanted) {
  const float* row = outputs[layout.outputs[0]].values.data();
  std::vector<Prediction> out;
  each_cell(kStrides, width, height, [&](const Cell& cell) {
    keep_cell(layout, row, row + layout.classes, cell, 0, wanted, &out);
    row += layout.classes + kSides;
  });
  return out;
}

std::optional<HeadLayout> recognise_picodet(NetworkOutputs outputs, int width, int height) {
  HeadLayout layout;
  for (const int stride : kStrides) {
    const int cells = cell_count({&stride, 1}, width, height);
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

std::vector<Prediction> decode_picodet(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                       const Wanted& wanted) {
  std::vector<Prediction> out;
  for (size_t i = 0; i < kStrides.size(); ++i) {
    const float* scores = outputs[layout.outputs[2 * i]].values.data();
    const float* sides = outputs[layout.outputs[2 * i + 1]].values.data();
    each_cell({&kStrides[i], 1}, width, height, [&](const Cell& cell) {
      keep_cell(layout, scores, sides, cell, 0.5f, wanted, &out);
      scores += layout.classes;
      sides += kSides;
    });
  }
  return out;
}

std::optional<HeadLayout> recognise_picodet_boxes(NetworkOutputs outputs, int width, int height) {
  const int cells = cell_count(kStrides, width, height);
  const auto boxes = output_of_dims(outputs, {1, cells, 4}), scores = output_of_dims(outputs, {1, -1, cells});
  if (!boxes || !scores || boxes == scores || outputs[*scores].dims[1] == 0) return std::nullopt;
  return HeadLayout{nullptr, outputs[*scores].dims[1], cells, {*boxes, *scores}};
}

std::vector<Prediction> decode_picodet_boxes(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                             const Wanted& wanted) {
  const float* boxes = outputs[layout.outputs[0]].values.data();
  return decode_channels(layout, outputs[layout.outputs[1]].values.data(), wanted, [&](size_t i) {
    return box_between(boxes[4 * i], boxes[4 * i + 1], boxes[4 * i + 2], boxes[4 * i + 3]);
  });
}

}  // namespace

std::vector<DetectorHead> distribution_heads() {
  return {
      // Distances count from a cell's corner.
      {.name = "NanoDet-Plus",
       .outputs = "1 x N x (C + 32), strides 8 to 64",
       .preprocessing = stretched_by_imagenet(true),
       .usual_input = 416,
       .recognise = recognise_nanodet_plus,
       .decode = decode_nanodet_plus},
      // As exported without what comes after the network: distances count from a cell's centre.
      {.name = "PicoDet",
       .outputs = "for each stride of 8 to 64 1 x N x C and 1 x N x 32",
       .preprocessing = stretched_by_imagenet(false),
       .usual_input = 416,
       .recognise = recognise_picodet,
       .decode = decode_picodet},
      // As exported with its boxes, in pixels of the input, but without suppression.
      {.name = "PicoDet without NMS",
       .outputs = "1 x N x 4 and 1 x C x N, strides 8 to 64",
       .preprocessing = stretched_by_imagenet(false),
       .usual_input = 416,
       .recognise = recognise_picodet_boxes,
       .decode = decode_picodet_boxes},
  };
}

}  // namespace dkb
