// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#if defined(__x86_64__)
#include <emmintrin.h>
#endif

namespace dkb {

// Flat grid over points of an image: which lie near a place? Points outside the image count to the cells at its rim.
class KeypointGrid {
 public:
  KeypointGrid() = default;
  // Of points with a `pixel` and an `octave`, in an image of this size [px].
  template <class Points>
  KeypointGrid(const Points& points, int width, int height) : columns_(width / kCell + 1), rows_(height / kCell + 1) {
    first_.assign(static_cast<size_t>(columns_ * rows_) + 1, 0);
    for (const auto& p : points) ++first_[cell(p.pixel.x(), p.pixel.y()) + 1];
    for (size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    const size_t padded = points.size() + kGroup;
    x_.resize(padded);
    y_.resize(padded);
    octave_.resize(padded);
    index_.resize(points.size());
    std::vector<int32_t> next(first_.begin(), first_.end() - 1);
    int32_t index = 0;
    for (const auto& p : points) {
      const auto k = static_cast<size_t>(next[cell(p.pixel.x(), p.pixel.y())]++);
      x_[k] = p.pixel.x();
      y_[k] = p.pixel.y();
      octave_[k] = p.octave;
      index_[k] = index++;
    }
  }

  // In an image of the same size as that of `other`.
  template <class Points>
  KeypointGrid(const Points& points, const KeypointGrid& other)
      : KeypointGrid(points, kCell * (other.columns_ - 1), kCell * (other.rows_ - 1)) {}

  // Where points are asked for: within `radius` [px] of (x, y), in both directions, on these octaves.
  struct Place {
    float x = 0, y = 0, radius = 0;
    int least_octave = 0, most_octave = 255;
  };
  // Calls visit(i) for every point there, cell by cell in row-major order, by increasing index within a cell.
  template <class Visit>
  void for_each_near(const Place& place, Visit&& visit) const {
    if (index_.empty()) return;
    const int c0 = column(place.x - place.radius), c1 = column(place.x + place.radius);
    const int r0 = row(place.y - place.radius), r1 = row(place.y + place.radius);
    for (int r = r0; r <= r1; ++r) {
      const auto from = static_cast<size_t>(first_[static_cast<size_t>(r * columns_ + c0)]);
      const auto to = static_cast<size_t>(first_[static_cast<size_t>(r * columns_ + c1) + 1]);
      for (size_t k = from; k < to; k += kGroup) {
        // Few of them lie within, which no processor foresees one by one.
        uint32_t within = group_within(k, place);
        if (to - k < kGroup) within &= (1U << (to - k)) - 1;
        for (; within != 0; within &= within - 1) visit(index_[k + static_cast<size_t>(std::countr_zero(within))]);
      }
    }
  }

 private:
  static constexpr int kCell = 16;  // [px]
  int column(float x) const { return std::clamp(static_cast<int>(x) / kCell, 0, columns_ - 1); }
  int row(float y) const { return std::clamp(static_cast<int>(y) / kCell, 0, rows_ - 1); }
  size_t cell(float x, float y) const { return static_cast<size_t>(row(y) * columns_ + column(x)); }

  // Which of the kGroup points from k on lie there, as bits.
  uint32_t group_within(size_t k, const Place& place) const {
#if defined(__x86_64__)
    const __m128 most = _mm_set1_ps(place.radius), least = _mm_set1_ps(-place.radius);
    const __m128 dx = _mm_sub_ps(_mm_loadu_ps(x_.data() + k), _mm_set1_ps(place.x));
    const __m128 dy = _mm_sub_ps(_mm_loadu_ps(y_.data() + k), _mm_set1_ps(place.y));
    const __m128 in_x = _mm_and_ps(_mm_cmple_ps(dx, most), _mm_cmpge_ps(dx, least));
    const __m128 in_y = _mm_and_ps(_mm_cmple_ps(dy, most), _mm_cmpge_ps(dy, least));
    int32_t octaves = 0;
    std::memcpy(&octaves, octave_.data() + k, kGroup);
    const __m128i zero = _mm_setzero_si128();
    const __m128i octave = _mm_unpacklo_epi16(_mm_unpacklo_epi8(_mm_cvtsi32_si128(octaves), zero), zero);
    const __m128i off_octave = _mm_or_si128(_mm_cmplt_epi32(octave, _mm_set1_epi32(place.least_octave)),
                                            _mm_cmpgt_epi32(octave, _mm_set1_epi32(place.most_octave)));
    return static_cast<uint32_t>(_mm_movemask_ps(_mm_andnot_ps(_mm_castsi128_ps(off_octave), _mm_and_ps(in_x, in_y))));
#else
    uint32_t within = 0;
    for (size_t i = 0; i < kGroup; ++i) {
      const float dx = x_[k + i] - place.x, dy = y_[k + i] - place.y, r = place.radius;
      const int octave = octave_[k + i];
      const bool in = (dx <= r) & (dx >= -r) & (dy <= r) & (dy >= -r) & (octave >= place.least_octave) &
                      (octave <= place.most_octave);
      within |= static_cast<uint32_t>(in) << i;
    }
    return within;
#endif
  }

  static constexpr size_t kGroup = 4;  // points compared at once
  int columns_ = 1, rows_ = 1;
  std::vector<int32_t> first_;   // point of each cell
  std::vector<float> x_, y_;     // by cells, with room for a group more
  std::vector<uint8_t> octave_;  // the same
  std::vector<int32_t> index_;
};

}  // namespace dkb
