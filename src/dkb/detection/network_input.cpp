// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/network_input.h"

#include <cmath>

#include "dkb/features/vectorised.h"

namespace dkb {
namespace {

constexpr float kPadding = 114;  // grey that YOLOv5 and YOLOX are trained with around images

// The samples of a bilinear resize along one direction: places of both in the source, and the weight of the second.
struct Taps {
  std::vector<int> first, second;
  std::vector<float> weight;

  // `step`: from one sample's place to the next.
  Taps(int source, int target, int step) : first(static_cast<size_t>(target)), second(first), weight(first.size()) {
    const float ratio = static_cast<float>(source) / static_cast<float>(target);
    for (size_t i = 0; i < first.size(); ++i) {
      const Tap tap = bilinear_tap((static_cast<float>(i) + 0.5f) * ratio, source);
      first[i] = tap.first * step;
      second[i] = tap.second * step;
      weight[i] = tap.weight;
    }
  }
};

// Resizes an image of `Channels` bytes a pixel into planes, whose origins are planes[c].
template <int Channels>
void resize_into(const ImageView& image, const Letterbox& box, const std::array<float, Channels>& scale,
                 const std::array<float, Channels>& offsets, std::array<float*, Channels> planes, Simd simd) {
  const Taps columns(box.image_width, box.scaled_width, Channels), rows(box.image_height, box.scaled_height, 1);
  std::vector<float> factors(static_cast<size_t>(box.image_width) * Channels), blended(factors.size());
  for (size_t i = 0; i < factors.size(); ++i) factors[i] = scale[i % Channels];
  for (float*& plane : planes) plane += static_cast<ptrdiff_t>(box.top) * box.input_width + box.left;
  for (size_t y = 0; y < rows.weight.size(); ++y) {
    run_vectorised(simd, [&, upper = image.row(rows.first[y]), lower = image.row(rows.second[y]),
                          weight = rows.weight[y], factor = factors.data()]() DKB_KERNEL_BODY {
      float* __restrict blend = blended.data();
      for (size_t i = 0; i < blended.size(); ++i) {
        const float above = upper[i];
        blend[i] = (above + weight * (static_cast<float>(lower[i]) - above)) * factor[i];
      }
      const int *const first = columns.first.data(), *const second = columns.second.data();
      const float* const right_weight = columns.weight.data();
      for (size_t c = 0; c < Channels; ++c) {
        const float* const channel = blend + c;
        const float offset = offsets[c];
        float* __restrict to = planes[c];
        for (size_t i = 0; i < columns.weight.size(); ++i) {
          const float left = channel[first[i]], right = channel[second[i]];
          to[i] = left + right_weight[i] * (right - left) + offset;
        }
      }
    });
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
