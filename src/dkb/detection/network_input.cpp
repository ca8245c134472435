// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/network_input.h"

#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

constexpr float kPadding = 114;  // grey of the training's letterboxes

// The samples of a bilinear resize along one direction: places of both in the source, and the weight of the second.
struct Taps {
  std::vector<int> first, second;
  std::vector<float> weight;

  // `step`: from one sample's place to the next.
  Taps(int source, int target, int step) : first(static_cast<size_t>(target)), second(first), weight(first.size()) {
    const float ratio = static_cast<float>(source) / static_cast<float>(target);
    for (size_t i = 0; i < first.size(); ++i) {
      const float at = std::clamp((static_cast<float>(i) + 0.5f) * ratio - 0.5f, 0.0f, static_cast<float>(source - 1));
      first[i] = static_cast<int>(at);
      weight[i] = at - static_cast<float>(first[i]);
      second[i] = std::min(first[i] + 1, source - 1) * step;
      first[i] *= step;
    }
  }
};

// One row of the resized image, in the planes that its channels go to.
template <int Channels>
struct Row {
  const uint8_t *upper, *lower;  // of the image, of `Channels` bytes a pixel
  float weight;                  // of the lower one
  const Taps& columns;
  const float* factors;  // of each value of `blended`
  const std::array<float, Channels>& offsets;
  std::vector<float>& blended;
  const std::array<float*, Channels>& to;
};

// Loops over flat arrays, for compilers to vectorise.
template <int Channels>
[[gnu::always_inline]] inline void resample(const Row<Channels>& row) {
  const uint8_t* const upper = row.upper;
  const uint8_t* const lower = row.lower;
  const float* const factors = row.factors;
  const float weight = row.weight;
  float* __restrict blended = row.blended.data();
  for (size_t i = 0; i < row.blended.size(); ++i) {
    const float above = upper[i];
    blended[i] = (above + weight * (static_cast<float>(lower[i]) - above)) * factors[i];
  }
  const int *const first = row.columns.first.data(), *const second = row.columns.second.data();
  const float* const right_weight = row.columns.weight.data();
  for (int c = 0; c < Channels; ++c) {
    const float* const channel = blended + c;
    const float offset = row.offsets[c];
    float* __restrict to = row.to[c];
    for (size_t i = 0; i < row.columns.weight.size(); ++i) {
      const float left = channel[first[i]], right = channel[second[i]];
      to[i] = left + right_weight[i] * (right - left) + offset;
    }
  }
}

template <int Channels>
void resample_scalar(const Row<Channels>& row) {
  resample(row);
}
#if defined(__x86_64__)
template <int Channels>
DKB_TARGET_AVX2 void resample_avx2(const Row<Channels>& row) {
  resample(row);
}
#endif

// Resizes an image of `Channels` bytes a pixel into planes, whose origins are planes[c].
template <int Channels>
void resize_into(const ImageView& image, const Letterbox& box, const std::array<float, Channels>& scale,
                 const std::array<float, Channels>& offsets, std::array<float*, Channels> planes, Simd simd) {
  const Taps columns(box.image_width, box.scaled_width, Channels), rows(box.image_height, box.scaled_height, 1);
  std::vector<float> factors(static_cast<size_t>(box.image_width) * Channels), blended(factors.size());
  for (size_t i = 0; i < factors.size(); ++i) factors[i] = scale[i % Channels];
  auto* one_row = resample_scalar<Channels>;
#if defined(__x86_64__)
  if (simd == Simd::avx2) one_row = resample_avx2<Channels>;
#endif
  for (float*& plane : planes) plane += static_cast<ptrdiff_t>(box.top) * box.input_width + box.left;
  for (size_t y = 0; y < rows.weight.size(); ++y) {
    one_row({image.row(rows.first[y]), image.row(rows.second[y]), rows.weight[y], columns, factors.data(), offsets,
             blended, planes});
    for (float*& plane : planes) plane += box.input_width;
  }
}

}  // namespace

Preprocessing stretched_by_imagenet(bool blue_first) {
  return {.fit = Preprocessing::Fit::stretched,
          .blue_first = blue_first,
          .mean = {123.675f, 116.28f, 103.53f},
          .scale = {1 / 58.395f, 1 / 57.12f, 1 / 57.375f}};
}

Letterbox Letterbox::place(Preprocessing::Fit fit, int image_width, int image_height, int input_width,
                           int input_height) {
  Letterbox box{input_width, input_height, image_width, image_height, input_width, input_height, 0, 0};
  if (fit == Preprocessing::Fit::stretched) return box;
  const double scale =
      std::min(static_cast<double>(input_width) / image_width, static_cast<double>(input_height) / image_height);
  const auto scaled = [&](int size, int limit) {
    return std::clamp(static_cast<int>(std::lround(size * scale)), 1, limit);
  };
  box.scaled_width = scaled(image_width, input_width);
  box.scaled_height = scaled(image_height, input_height);
  if (fit == Preprocessing::Fit::centred) {
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

void fill_blob(const DetectorInput& image, const Letterbox& box, const Preprocessing& preprocessing,
               std::vector<float>* blob, Simd simd) {
  const size_t plane = static_cast<size_t>(box.input_width) * static_cast<size_t>(box.input_height);
  blob->resize(3 * plane);
  std::array<float*, 3> planes;  // of red, green and blue
  std::array<float, 3> offsets;
  for (size_t c = 0; c < 3; ++c) {
    planes[c] = blob->data() + plane * (preprocessing.blue_first ? 2 - c : c);
    offsets[c] = 0 - preprocessing.mean[c] * preprocessing.scale[c];
    if (box.scaled_width < box.input_width || box.scaled_height < box.input_height)
      std::fill_n(planes[c], plane, kPadding * preprocessing.scale[c] + offsets[c]);
  }
  if (!image.colour.empty())
    resize_into<3>(image.colour, box, preprocessing.scale, offsets, planes, simd);
  else
    for (size_t c = 0; c < 3; ++c)
      resize_into<1>(image.grey, box, {preprocessing.scale[c]}, {offsets[c]}, {planes[c]}, simd);
}

}  // namespace dkb
