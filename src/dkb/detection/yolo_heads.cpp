// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/yolo_heads.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dkb {
namespace {

constexpr int kStrides[] = {8, 16, 32};
constexpr float kPadding = 114;  // grey of the training's letterboxes
constexpr size_t kMaxCandidates = 1000;

int cell_count(int width, int height) {
  int cells = 0;
  for (const int stride : kStrides) cells += (width / stride) * (height / stride);
  return cells;
}

// One output column or row of a bilinear resize: which two samples of the source, and the weight of the second.
struct Tap {
  int first = 0, second = 0;
  float weight = 0;
};

std::vector<Tap> taps(int source, int target) {
  std::vector<Tap> out(static_cast<size_t>(target));
  const float step = static_cast<float>(source) / static_cast<float>(target);
  for (int i = 0; i < target; ++i) {
    const float at = std::clamp((static_cast<float>(i) + 0.5f) * step - 0.5f, 0.0f, static_cast<float>(source - 1));
    const int first = static_cast<int>(at);
    out[static_cast<size_t>(i)] = {first, std::min(first + 1, source - 1), at - static_cast<float>(first)};
  }
  return out;
}

// Resizes the interleaved image of `Channels` bytes a pixel into planes of the blob; plane[c] takes channel c.
template <int Channels>
void resize_into(const uint8_t* pixels, const Letterbox& box, float factor,
                 const std::array<float*, Channels>& planes) {
  const std::vector<Tap> columns = taps(box.image_width, box.scaled_width);
  const std::vector<Tap> rows = taps(box.image_height, box.scaled_height);
  const size_t stride = static_cast<size_t>(box.image_width) * Channels;
  std::vector<float> blended(stride);
  for (int y = 0; y < box.scaled_height; ++y) {
    const Tap& row = rows[static_cast<size_t>(y)];
    const uint8_t* a = pixels + stride * static_cast<size_t>(row.first);
    const uint8_t* b = pixels + stride * static_cast<size_t>(row.second);
    for (size_t i = 0; i < stride; ++i) {
      const float upper = a[i];
      blended[i] = (upper + row.weight * (static_cast<float>(b[i]) - upper)) * factor;
    }
    const size_t start =
        static_cast<size_t>(box.top + y) * static_cast<size_t>(box.input_width) + static_cast<size_t>(box.left);
    for (int c = 0; c < Channels; ++c) {
      float* out = planes[static_cast<size_t>(c)] + start;
      for (const Tap& column : columns) {
        const float left = blended[static_cast<size_t>(column.first * Channels + c)];
        const float right = blended[static_cast<size_t>(column.second * Channels + c)];
        *out++ = left + column.weight * (right - left);
      }
    }
  }
}

bool is_finite(const Box& b) {
  return std::isfinite(b.x) && std::isfinite(b.y) && std::isfinite(b.w) && std::isfinite(b.h);
}

void keep(int class_id, float score, float cx, float cy, float w, float h, std::vector<Prediction>* out) {
  const Box box{cx - w / 2, cy - h / 2, w, h};
  if (is_finite(box) && std::isfinite(score) && w > 0 && h > 0) out->push_back({class_id, box, score});
}

// Calls use(values, class, score) for each row cx cy w h objectness classes... that reaches `min_score`.
template <class Use>
void each_objectness_row(const HeadLayout& layout, const float* row, size_t first, size_t count,
                         const std::vector<bool>& movable, float min_score, const Use& use) {
  const size_t width = 5 + static_cast<size_t>(layout.classes);
  row += first * width;
  for (size_t i = 0; i < count; ++i, row += width) {
    if (!(row[4] >= min_score)) continue;  // scores are at most 1
    const float* best = std::max_element(row + 5, row + width);
    const int class_id = static_cast<int>(best - (row + 5));
    const float score = row[4] * *best;
    if (score >= min_score && movable[static_cast<size_t>(class_id)]) use(i, row, class_id, score);
  }
}

std::vector<Prediction> decode_v5(const HeadLayout& layout, const float* output, const std::vector<bool>& movable,
                                  float min_score) {
  std::vector<Prediction> out;
  each_objectness_row(
      layout, output, 0, static_cast<size_t>(layout.predictions), movable, min_score,
      [&](size_t, const float* v, int c, float score) { keep(c, score, v[0], v[1], v[2], v[3], &out); });
  return out;
}

// YOLOX (Ge et al. 2021): centre = (offset + cell) * stride, size = exp(value) * stride.
std::vector<Prediction> decode_yolox(const HeadLayout& layout, const float* output, int input_width, int input_height,
                                     const std::vector<bool>& movable, float min_score) {
  std::vector<Prediction> out;
  size_t first = 0;
  for (const int stride : kStrides) {
    const auto columns = static_cast<size_t>(input_width / stride);
    const size_t cells = columns * static_cast<size_t>(input_height / stride);
    const auto s = static_cast<float>(stride);
    each_objectness_row(layout, output, first, cells, movable, min_score,
                        [&](size_t cell, const float* v, int c, float score) {
                          const auto x = static_cast<float>(cell % columns), y = static_cast<float>(cell / columns);
                          keep(c, score, (v[0] + x) * s, (v[1] + y) * s, std::exp(v[2]) * s, std::exp(v[3]) * s, &out);
                        });
    first += cells;
  }
  return out;
}

std::vector<Prediction> decode_v8(const HeadLayout& layout, const float* output, const std::vector<bool>& movable,
                                  float min_score) {
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
    if (best[i] >= min_score && movable[static_cast<size_t>(best_class[i])])
      keep(best_class[i], best[i], output[i], output[n + i], output[2 * n + i], output[3 * n + i], &out);
  return out;
}

}  // namespace

const char* to_string(YoloHead head) {
  return head == YoloHead::v5 ? "YOLOv5" : head == YoloHead::yolox ? "YOLOX" : "YOLOv8";
}

std::optional<HeadLayout> recognise_head(std::span<const int> dims, int input_width, int input_height) {
  if (dims.size() != 3 || dims[0] != 1) return std::nullopt;
  const int cells = cell_count(input_width, input_height);
  if (cells == 0) return std::nullopt;
  if (dims[1] == 3 * cells && dims[2] > 5) return HeadLayout{YoloHead::v5, dims[2] - 5, dims[1]};
  if (dims[1] == cells && dims[2] > 5) return HeadLayout{YoloHead::yolox, dims[2] - 5, dims[1]};
  if (dims[2] == cells && dims[1] > 4) return HeadLayout{YoloHead::v8, dims[1] - 4, dims[2]};
  return std::nullopt;
}

Letterbox Letterbox::fit(YoloHead head, int image_width, int image_height, int input_width, int input_height) {
  Letterbox box{input_width, input_height, image_width, image_height, 0, 0, 0, 0};
  const double scale =
      std::min(static_cast<double>(input_width) / image_width, static_cast<double>(input_height) / image_height);
  const auto scaled = [&](int size, int limit) {
    return std::clamp(static_cast<int>(std::lround(size * scale)), 1, limit);
  };
  box.scaled_width = scaled(image_width, input_width);
  box.scaled_height = scaled(image_height, input_height);
  if (head != YoloHead::yolox) {
    box.left = (input_width - box.scaled_width) / 2;
    box.top = (input_height - box.scaled_height) / 2;
  }
  return box;
}

Box Letterbox::to_image(const Box& b) const {
  const float sx = static_cast<float>(image_width) / static_cast<float>(scaled_width);
  const float sy = static_cast<float>(image_height) / static_cast<float>(scaled_height);
  return {(b.x - static_cast<float>(left)) * sx, (b.y - static_cast<float>(top)) * sy, b.w * sx, b.h * sy};
}

Box Letterbox::to_input(const Box& b) const {
  const float sx = static_cast<float>(scaled_width) / static_cast<float>(image_width);
  const float sy = static_cast<float>(scaled_height) / static_cast<float>(image_height);
  return {b.x * sx + static_cast<float>(left), b.y * sy + static_cast<float>(top), b.w * sx, b.h * sy};
}

void fill_blob(const DetectorInput& image, const Letterbox& box, YoloHead head, std::vector<float>* blob) {
  const float factor = head == YoloHead::yolox ? 1.0f : 1.0f / 255.0f;
  const size_t plane = static_cast<size_t>(box.input_width) * static_cast<size_t>(box.input_height);
  blob->assign(3 * plane, kPadding * factor);
  float* const planes[] = {blob->data(), blob->data() + plane, blob->data() + 2 * plane};
  if (image.colour.empty()) {
    resize_into<1>(image.grey.row(0), box, factor, {planes[0]});
    std::copy_n(planes[0], plane, planes[1]);
    std::copy_n(planes[0], plane, planes[2]);
    return;
  }
  const int red = head == YoloHead::yolox ? 2 : 0;
  resize_into<3>(image.colour.row(0), box, factor, {planes[red], planes[1], planes[2 - red]});
}

std::vector<Prediction> decode(const HeadLayout& layout, std::span<const float> output, int input_width,
                               int input_height, const std::vector<bool>& movable, float min_score) {
  switch (layout.kind) {
    case YoloHead::v5:
      return decode_v5(layout, output.data(), movable, min_score);
    case YoloHead::yolox:
      return decode_yolox(layout, output.data(), input_width, input_height, movable, min_score);
    case YoloHead::v8:
      break;
  }
  return decode_v8(layout, output.data(), movable, min_score);
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

}  // namespace dkb
