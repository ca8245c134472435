// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/brief_tests.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dkb/features/steered_brief.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

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

std::array<BriefTest, kBriefTests.size()> make_brief_tests() {
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
  for (double limit = 0.1; chosen.size() < kBriefTests.size(); limit += 0.05)
    for (size_t i = 0; i < kCandidates && chosen.size() < kBriefTests.size(); ++i) {
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
  std::array<BriefTest, kBriefTests.size()> tests;
  std::transform(chosen.begin(), chosen.end(), tests.begin(), [](const Candidate* c) { return c->test; });
  return tests;
}

TEST(BriefTests, AreThoseThatTheModelDraws) {
  const auto drawn = make_brief_tests();
  for (size_t i = 0; i < drawn.size(); ++i) {
    EXPECT_NEAR(kBriefTests[i].ax, drawn[i].ax, 1e-4) << i;
    EXPECT_NEAR(kBriefTests[i].ay, drawn[i].ay, 1e-4) << i;
    EXPECT_NEAR(kBriefTests[i].bx, drawn[i].bx, 1e-4) << i;
    EXPECT_NEAR(kBriefTests[i].by, drawn[i].by, 1e-4) << i;
  }
}

TEST(BriefTests, AreDistinctAndStayInsideTheDisc) {
  for (size_t i = 0; i < kBriefTests.size(); ++i) {
    const BriefTest& a = kBriefTests[i];
    EXPECT_LE(std::hypot(a.ax, a.ay), kBriefRadius);
    EXPECT_LE(std::hypot(a.bx, a.by), kBriefRadius);
    for (size_t j = 0; j < i; ++j)
      EXPECT_FALSE(a.ax == kBriefTests[j].ax && a.ay == kBriefTests[j].ay && a.bx == kBriefTests[j].bx);
  }
}

}  // namespace
}  // namespace dkb
