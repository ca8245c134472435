// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detector_heads.h"

#include <algorithm>

#include "dkb/detection/head_families.h"

namespace dkb {
namespace {

constexpr size_t kMaxCandidates = 1000;  // suppression compares each with each

}  // namespace

bool has_dims(const OnnxNetwork::Output& output, std::initializer_list<int> dims) {
  return std::equal(output.dims.begin(), output.dims.end(), dims.begin(), dims.end(),
                    [](int have, int want) { return want == -1 || have == want; });
}

std::optional<size_t> output_named(NetworkOutputs outputs, const char* name) {
  for (size_t i = 0; i < outputs.size(); ++i)
    if (outputs[i].name == name) return i;
  return std::nullopt;
}

std::optional<size_t> output_of_dims(NetworkOutputs outputs, std::initializer_list<int> dims) {
  for (size_t i = 0; i < outputs.size(); ++i)
    if (has_dims(outputs[i], dims)) return i;
  return std::nullopt;
}

std::optional<HeadLayout> rows_of(NetworkOutputs outputs, int predictions, int others) {
  const auto output = output_of_dims(outputs, {1, predictions, -1});
  if (predictions == 0 || !output || outputs[*output].dims[2] <= others) return std::nullopt;
  return HeadLayout{nullptr, outputs[*output].dims[2] - others, predictions, {*output}};
}

int cell_count(std::span<const int> strides, int width, int height) {
  int cells = 0;
  for (const int stride : strides) cells += ((width + stride - 1) / stride) * ((height + stride - 1) / stride);
  return cells;
}

std::span<const DetectorHead> detector_heads() {
  static const std::vector<DetectorHead> heads = [] {
    std::vector<DetectorHead> all;
    for (const auto& family : {yolo_heads(), distribution_heads(), detr_heads()})
      all.insert(all.end(), family.begin(), family.end());
    return all;
  }();
  return heads;
}

std::optional<HeadLayout> recognise_head(NetworkOutputs outputs, int width, int height) {
  for (const OnnxNetwork::Output& output : outputs) {
    size_t values = 1;
    for (const int size : output.dims) {
      if (size < 0 || (size > 0 && values > output.values.size() / static_cast<size_t>(size) + 1)) return std::nullopt;
      values *= static_cast<size_t>(size);
    }
    if (values != output.values.size()) return std::nullopt;
  }
  for (const DetectorHead& head : detector_heads())
    if (auto layout = head.recognise(outputs, width, height)) {
      layout->head = &head;
      return layout;
    }
  return std::nullopt;
}

std::vector<Prediction> suppress_overlaps(std::vector<Prediction> predictions, float max_overlap) {
  std::stable_sort(predictions.begin(), predictions.end(),
                   [](const Prediction& a, const Prediction& b) { return a.score > b.score; });
  if (predictions.size() > kMaxCandidates) predictions.resize(kMaxCandidates);
  std::vector<Prediction> kept;
  for (const Prediction& p : predictions)
    if (std::none_of(kept.begin(), kept.end(), [&](const Prediction& k) {
          return k.class_id == p.class_id && intersection_over_union(k.box, p.box) > max_overlap;
        }))
      kept.push_back(p);
  return kept;
}

void paint_mask(const MaskLogits& logits, const Letterbox& letterbox, const Box& box, GreyImage* mask) {
  const Box area = clip(box, mask->width(), mask->height());
  // The pixels whose centres lie in the box.
  const int left = static_cast<int>(std::ceil(area.x - 0.5f)),
            right = static_cast<int>(std::ceil(area.x + area.w - 0.5f));
  const int top = static_cast<int>(std::ceil(area.y - 0.5f)),
            bottom = static_cast<int>(std::ceil(area.y + area.h - 0.5f));
  // From the image's pixels over the input's to the mask's.
  const auto taps = [](int first, int end, int image, int scaled, int before, int input, int size) {
    const float to_mask = static_cast<float>(size) / static_cast<float>(input);
    const float scale = static_cast<float>(scaled) / static_cast<float>(image) * to_mask;
    const float offset = static_cast<float>(before) * to_mask;
    std::vector<Tap> all;
    for (int i = first; i < end; ++i)
      all.push_back(bilinear_tap((static_cast<float>(i) + 0.5f) * scale + offset, size));
    return all;
  };
  const std::vector<Tap> columns = taps(left, right, letterbox.image_width, letterbox.scaled_width, letterbox.left,
                                        letterbox.input_width, logits.width);
  const std::vector<Tap> rows = taps(top, bottom, letterbox.image_height, letterbox.scaled_height, letterbox.top,
                                     letterbox.input_height, logits.height);
  std::vector<float> blended(static_cast<size_t>(logits.width));
  for (size_t y = 0; y < rows.size(); ++y) {
    const float* above = logits.values.data() + static_cast<ptrdiff_t>(rows[y].first) * logits.width;
    const float* below = logits.values.data() + static_cast<ptrdiff_t>(rows[y].second) * logits.width;
    for (size_t i = 0; i < blended.size(); ++i) blended[i] = above[i] + rows[y].weight * (below[i] - above[i]);
    uint8_t* out = mask->row(top + static_cast<int>(y)) + left;
    for (size_t x = 0; x < columns.size(); ++x) {
      const float a = blended[static_cast<size_t>(columns[x].first)],
                  b = blended[static_cast<size_t>(columns[x].second)];
      if (a + columns[x].weight * (b - a) > 0) out[x] = 255;
    }
  }
}

}  // namespace dkb
