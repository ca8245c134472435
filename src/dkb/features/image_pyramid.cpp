// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/image_pyramid.h"

#include <algorithm>
#include <cmath>

#include "dkb/features/vectorised.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kRowOne = 128;      // weight of one row: 255 * 128 fits a signed 16-bit number
constexpr int kColumnOne = 2048;  // weight of one column
constexpr int kShift = 18;        // log2(kRowOne * kColumnOne)
constexpr int kRound = 1 << (kShift - 1);
constexpr int kPadding = 32;  // entries that vector loads may read past the end of a row buffer

// The row of the source at `index` and the next one, blended by the second one's weight.
void blend_rows(Simd simd, const GreyImage& source, int index, int weight, int16_t* blended) {
  const uint8_t* const a = source.row(index);
  const uint8_t* const b = source.row(std::min(index + 1, source.height() - 1));
  run_vectorised(simd, [a, b, weight, width = source.width(), blended]() DKB_KERNEL_BODY {
    DKB_INDEPENDENT_STEPS
    for (int x = 0; x < width; ++x) blended[x] = static_cast<int16_t>(a[x] * (kRowOne - weight) + b[x] * weight);
  });
}

}  // namespace

void ImagePyramidOptions::check() const {
  require_option(levels >= 1 && levels <= 16, "levels", levels, "in 1 ... 16");
  require_option(scale > 1.0 && scale <= 4.0, "scale", scale, "in (1, 4]");
  require_option(min_size >= 1, "min_size", min_size, ">= 1");
}

ImagePyramid::ImagePyramid(ImagePyramidOptions options, Simd simd) : options_(options), simd_(simd) {
  options_.check();
}

std::vector<ImagePyramid::Tap> ImagePyramid::make_taps(int source, int target, int one) {
  std::vector<Tap> taps(static_cast<size_t>(target));
  const double ratio = static_cast<double>(source) / target;
  for (int i = 0; i < target; ++i) {
    const double position = std::clamp((i + 0.5) * ratio - 0.5, 0.0, source - 1.0);
    const int index = std::clamp(static_cast<int>(position), 0, std::max(0, source - 2));
    const int weight = source == 1 ? 0 : static_cast<int>(std::lround((position - index) * one));
    taps[static_cast<size_t>(i)] = {index, weight};
  }
  return taps;
}

ImagePyramid::Resampling ImagePyramid::make_resampling(int width, int height, int next_width, int next_height,
                                                       Simd simd) {
  Resampling plan;
  plan.rows = make_taps(height, next_height, kRowOne);
  plan.columns = make_taps(width, next_width, kColumnOne);
  plan.simd = simd;
  for (size_t x = 0; x < plan.columns.size(); ++x) {
    const Tap& tap = plan.columns[x];
    if (x % 4 == 0) plan.group_start.push_back(tap.index);
    if (x % 16 == 0) plan.wide_start.push_back(tap.index);
    const int byte = 2 * (tap.index - plan.group_start.back()), column = tap.index - plan.wide_start.back();
    if (byte > 12) plan.simd = Simd::scalar;  // two 16-bit pixels must lie within the 16 bytes loaded
    if (column > 30) plan.simd = std::min(plan.simd, Simd::avx2);  // and within 32 columns
    for (int k = 0; k < 4; ++k) plan.shuffles.push_back(static_cast<uint8_t>(byte + k));
    for (int k = 0; k < 2; ++k) plan.wide_columns.push_back(static_cast<uint16_t>(column + k));
    plan.weights.push_back(static_cast<int16_t>(kColumnOne - tap.weight));
    plan.weights.push_back(static_cast<int16_t>(tap.weight));
  }
  return plan;
}

void ImagePyramid::plan(int width, int height) {
  images_.assign(1, GreyImage(width, height));
  resamplings_.clear();
  scales_.assign(1, Scale{});
  for (int i = 1; i < options_.levels; ++i) {
    const double factor = std::pow(options_.scale, i);
    const int w = static_cast<int>(std::lround(width / factor)), h = static_cast<int>(std::lround(height / factor));
    if (std::min(w, h) < options_.min_size) break;
    resamplings_.push_back(make_resampling(images_.back().width(), images_.back().height(), w, h, simd_));
    images_.emplace_back(w, h);
    scales_.push_back({static_cast<double>(width) / w, static_cast<double>(height) / h});
  }
  row_buffer_.assign(static_cast<size_t>(width + kPadding), 0);
}

void ImagePyramid::build(const GreyImage& image) {
  start(image);
  for (int i = 1; i < levels(); ++i) build_level(i);
}

void ImagePyramid::start(const GreyImage& image) {
  if (image.empty()) throw InputError("image pyramid: the image is empty; give one with at least one pixel");
  if (images_.empty() || images_[0].width() != image.width() || images_[0].height() != image.height())
    plan(image.width(), image.height());
  std::copy(image.data(), image.data() + image.size(), images_[0].data());
}

void ImagePyramid::build_level(int index) {
  const auto i = static_cast<size_t>(index);
  const Resampling& resampling = resamplings_[i - 1];
  for (int y = 0; y < images_[i].height(); ++y) {
    const Tap row = resampling.rows[static_cast<size_t>(y)];
    blend_rows(resampling.simd, images_[i - 1], row.index, row.weight, row_buffer_.data());
    resampling.interpolate(row_buffer_.data(), images_[i].row(y));
  }
}

void ImagePyramid::Resampling::interpolate(const int16_t* blended, uint8_t* out) const {
  size_t x = 0;
#if defined(__x86_64__)
  if (simd == Simd::avx512) x = interpolate_avx512(blended, out);
  if (simd == Simd::avx2) x = interpolate_avx2(blended, out);
#endif
  for (; x < columns.size(); ++x) {
    const int32_t w = columns[x].weight;
    const int16_t* v = blended + columns[x].index;
    out[x] = static_cast<uint8_t>((v[0] * (kColumnOne - w) + v[1] * w + kRound) >> kShift);
  }
}

#if defined(__x86_64__)
// These read by copies of the addresses: for all that the compiler knows, what they write may be the vectors
// themselves.
DKB_TARGET_AVX2 size_t ImagePyramid::Resampling::interpolate_avx2(const int16_t* blended, uint8_t* out) const {
  const size_t groups = (columns.size() / 4) & ~size_t{1};  // two groups of four pixels a step
  const auto* const starts = group_start.data();
  const auto* const sources = shuffles.data();
  const auto* const factors = weights.data();
  const __m256i round = _mm256_set1_epi32(kRound);
  for (size_t g = 0; g < groups; g += 2) {
    const __m128i low = _mm_loadu_si128(reinterpret_cast<const __m128i*>(blended + starts[g]));
    const __m128i high = _mm_loadu_si128(reinterpret_cast<const __m128i*>(blended + starts[g + 1]));
    const __m256i shuffle = load_avx2(sources + 16 * g);
    const __m256i pairs = _mm256_shuffle_epi8(_mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1), shuffle);
    const __m256i rounded = _mm256_add_epi32(_mm256_madd_epi16(pairs, load_avx2(factors + 8 * g)), round);
    const __m256i sums = _mm256_srai_epi32(rounded, kShift);
    const __m256i words = _mm256_packus_epi32(sums, sums);
    const __m256i bytes = _mm256_packus_epi16(words, words);
    const uint32_t left = static_cast<uint32_t>(_mm_cvtsi128_si32(_mm256_castsi256_si128(bytes)));
    const uint32_t right = static_cast<uint32_t>(_mm_cvtsi128_si32(_mm256_extracti128_si256(bytes, 1)));
    const uint64_t both = left | (static_cast<uint64_t>(right) << 32);
    __builtin_memcpy(out + 4 * g, &both, 8);
  }
  return 4 * groups;
}

DKB_TARGET_AVX512 size_t ImagePyramid::Resampling::interpolate_avx512(const int16_t* blended, uint8_t* out) const {
  const size_t groups = columns.size() / 16;
  const __m512i round = _mm512_set1_epi32(kRound);
  const auto* const starts = wide_start.data();
  const auto* const sources = wide_columns.data();
  const auto* const factors = weights.data();
  for (size_t g = 0; g < groups; ++g) {
    const __m512i chosen = _mm512_loadu_si512(sources + 32 * g);
    const __m512i pairs = _mm512_permutexvar_epi16(chosen, _mm512_loadu_si512(blended + starts[g]));
    // Masked, since GCC 12 warns of the undefined register that the plain ones start from.
    const __m512i rounded = _mm512_add_epi32(_mm512_madd_epi16(pairs, _mm512_loadu_si512(factors + 32 * g)), round);
    const __m512i sums = _mm512_maskz_srai_epi32(0xFFFF, rounded, kShift);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + 16 * g), _mm512_maskz_cvtepi32_epi8(0xFFFF, sums));
  }
  return 16 * groups;
}
#endif

}  // namespace dkb
