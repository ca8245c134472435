// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/steered_brief.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr size_t kTests = 256;

// Model of image statistics about a corner: a stationary field whose correlation falls with distance, plus a random
// slope along the orientation, since the centroid lies there by definition.
constexpr double kCorrelationLength = 8.0;  // [px]
constexpr double kSlope = 0.06;             // mean rise per pixel along the orientation, in deviations of intensity

class ImageModel {
 public:
  ImageModel() {
    for (size_t i = 0; i < table_.size(); ++i)
      table_[i] = std::exp(-(std::sqrt(static_cast<double>(i) / kSteps + 4.0) - 2.0) / kCorrelationLength);
  }
  double correlation(double dx, double dy) const { return table_[static_cast<size_t>((dx * dx + dy * dy) * kSteps)]; }
  // Covariance of the differences that two tests look at.
  double covariance(const BriefTest& s, const BriefTest& t) const {
    return correlation(s.ax - t.ax, s.ay - t.ay) - correlation(s.ax - t.bx, s.ay - t.by) -
           correlation(s.bx - t.ax, s.by - t.ay) + correlation(s.bx - t.bx, s.by - t.by);
  }

 private:
  static constexpr double kSteps = 8.0;
  std::array<double, 8 * 4 * kBriefRadius * kBriefRadius + 9> table_{};
};

#if defined(__x86_64__)
DKB_TARGET_AVX2 Descriptor describe_avx2(const uint8_t* centre, ptrdiff_t stride, const void* first,
                                         const void* second) {
  const __m256i* a = static_cast<const __m256i*>(first);
  const __m256i* b = static_cast<const __m256i*>(second);
  const __m256i strides = _mm256_set1_epi32(static_cast<int32_t>(static_cast<uint32_t>(stride) << 16 | 1u));
  const __m256i byte = _mm256_set1_epi32(0xFF);
  const int* base = reinterpret_cast<const int*>(centre);
  Descriptor descriptor;
  for (size_t word = 0; word < 4; ++word) {
    uint64_t bits = 0;
    for (size_t k = 0; k < 8; ++k) {
      const __m256i ia = _mm256_madd_epi16(load_avx2(a + 8 * word + k), strides);
      const __m256i ib = _mm256_madd_epi16(load_avx2(b + 8 * word + k), strides);
      const __m256i va = _mm256_and_si256(_mm256_i32gather_epi32(base, ia, 1), byte);
      const __m256i vb = _mm256_and_si256(_mm256_i32gather_epi32(base, ib, 1), byte);
      const int mask = _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(vb, va)));
      bits |= static_cast<uint64_t>(static_cast<uint32_t>(mask)) << (8 * k);
    }
    descriptor[word] = bits;
  }
  return descriptor;
}
#endif

}  // namespace

std::array<BriefTest, kTests> make_brief_tests() {
  constexpr size_t kCandidates = 6000;
  constexpr double kSigma = 9.0;  // [px]; matched best on real frames, of 5.2, 6.2, 7.5, 9 and 12
  const ImageModel model;
  Random random(20);
  struct Candidate {
    BriefTest test;
    double deviation = 0;
    size_t checked = 0;  // against so many of the chosen it passed; a limit once raised does not fall again
  };
  std::vector<Candidate> candidates;
  const auto draw = [&random](float& x, float& y) {
    do {
      x = static_cast<float>(kSigma * random.normal());
      y = static_cast<float>(kSigma * random.normal());
    } while (x * x + y * y > static_cast<float>(kBriefRadius * kBriefRadius));
  };
  while (candidates.size() < kCandidates) {
    Candidate candidate;
    BriefTest& test = candidate.test;
    draw(test.ax, test.ay);
    draw(test.bx, test.by);
    if (std::hypot(test.ax - test.bx, test.ay - test.by) < 4.0F) continue;  // nothing but noise to compare
    candidate.deviation = std::sqrt(model.covariance(test, test));
    if (std::abs(test.ax - test.bx) * kSlope > 0.5 * candidate.deviation) continue;  // the answer is known beforehand
    candidates.push_back(candidate);
  }
  // Raise the allowed correlation until enough candidates pass.
  std::vector<const Candidate*> chosen;
  std::vector<bool> taken(kCandidates, false);
  for (double limit = 0.1; chosen.size() < kTests; limit += 0.05)
    for (size_t i = 0; i < kCandidates && chosen.size() < kTests; ++i) {
      if (taken[i]) continue;
      Candidate& candidate = candidates[i];
      const auto independent = [&](const Candidate* other) {
        return std::abs(model.covariance(candidate.test, other->test)) <=
               limit * candidate.deviation * other->deviation;
      };
      while (candidate.checked < chosen.size() && independent(chosen[candidate.checked])) ++candidate.checked;
      if (candidate.checked < chosen.size()) continue;
      taken[i] = true;
      chosen.push_back(&candidate);
    }
  std::array<BriefTest, kTests> tests;
  std::transform(chosen.begin(), chosen.end(), tests.begin(), [](const Candidate* c) { return c->test; });
  return tests;
}

SteeredBrief::SteeredBrief(Simd simd) : simd_(simd), offsets_(static_cast<size_t>(kRotations) * 2 * kTests) {
  // Drawn once: it takes longer than a frame.
  static const std::array<BriefTest, kTests> tests = make_brief_tests();
  for (int r = 0; r < kRotations; ++r) {
    const double angle = 2.0 * std::numbers::pi * r / kRotations;
    const double c = std::cos(angle), s = std::sin(angle);
    Offset* first = offsets_.data() + static_cast<size_t>(r) * 2 * kTests;
    Offset* second = first + kTests;
    const auto steer = [c, s](double x, double y) {
      return Offset{static_cast<int16_t>(std::lround(c * x - s * y)), static_cast<int16_t>(std::lround(s * x + c * y))};
    };
    for (size_t i = 0; i < kTests; ++i) {
      first[i] = steer(tests[i].ax, tests[i].ay);
      second[i] = steer(tests[i].bx, tests[i].by);
    }
  }
}

Descriptor SteeredBrief::describe(const uint8_t* centre, ptrdiff_t stride, float angle) const {
  constexpr float kSteps = static_cast<float>(kRotations) / (2.0F * std::numbers::pi_v<float>);
  const int rotation = static_cast<int>(angle * kSteps + 0.5F) % kRotations;
  const Offset* first = offsets_.data() + static_cast<size_t>(rotation) * 2 * kTests;
  const Offset* second = first + kTests;
#if defined(__x86_64__)
  if (simd_ >= Simd::avx2) return describe_avx2(centre, stride, first, second);
#endif
  Descriptor descriptor;
  for (size_t word = 0; word < 4; ++word) {
    uint64_t bits = 0;
    for (size_t k = 0; k < 64; ++k) {
      const Offset a = first[64 * word + k], b = second[64 * word + k];
      bits |= static_cast<uint64_t>(centre[a.y * stride + a.x] < centre[b.y * stride + b.x]) << k;
    }
    descriptor[word] = bits;
  }
  return descriptor;
}

}  // namespace dkb
