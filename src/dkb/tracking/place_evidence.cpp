// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/place_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dkb {
namespace {

// [m] Points so near to each other belong to one thing, and are judged together: of 0.05 to 0.3 the best
// (decisions.md).
constexpr double kDetail = 0.3;
constexpr int kMaxVotes = 10;  // of one point: what a camera saw before it came here is outvoted in as many frames
constexpr int kMinPoints = 4;  // of a detail: the fewest of which three in four can look different

// Shares of the details that look different. Of places that a camera came back to 0.3 to 1 % do (freiburg1_xyz,
// walking_halfsphere, the composed sequences, `loop`); of the second room of `twins` seen as the first one a tenth.
constexpr double kOtherInPlace = 0.02, kOtherInLookAlike = 0.1;
const double kPriorOdds = std::log(5.0);  // a look-alike is thought to be a fifth as likely as the place itself

}  // namespace

void PlaceEvidence::add(std::vector<PointLook> looks) {
  const auto before = [](const PointLook& a, const PointLook& b) { return a.id < b.id; };
  const auto of_same = [](const PointLook& a, const PointLook& b) { return a.id == b.id; };
  std::stable_sort(looks.begin(), looks.end(), before);
  looks.erase(std::unique(looks.begin(), looks.end(), of_same), looks.end());
  for (const PointLook& look : looks) {
    int& votes = votes_[look.id];
    votes = std::clamp(votes + (look.same ? 1 : -1), -kMaxVotes, kMaxVotes);
  }
}

double PlaceEvidence::log_odds(const std::vector<Candidate>& points) const {
  struct Detail {
    int same = 0, other = 0;  // points
  };
  std::map<std::array<int, 3>, Detail> details;
  for (const Candidate& point : points) {
    const auto votes = votes_.find(point.id);
    if (votes == votes_.end() || votes->second == 0) continue;
    const Eigen::Vector3i at = (point.position / kDetail).array().floor().cast<int>();
    Detail& detail = details[{at.x(), at.y(), at.z()}];
    ++(votes->second > 0 ? detail.same : detail.other);
  }
  const double same_odds = std::log((1 - kOtherInPlace) / (1 - kOtherInLookAlike));
  const double other_odds = std::log(kOtherInPlace / kOtherInLookAlike);
  double odds = kPriorOdds;
  for (const auto& [at, detail] : details) {
    if (detail.same + detail.other < kMinPoints) continue;
    // Corners fail one by one, by blur and by what was described wrongly; something else there changes nearly all.
    if (detail.other >= 3 * detail.same)
      odds += other_odds;
    else if (detail.same >= detail.other)
      odds += same_odds;
  }
  return odds;
}

}  // namespace dkb
