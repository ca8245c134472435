// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/match_quality.h"

#include <algorithm>

namespace dkb {
namespace {

double ratio(int a, int b) {
  return static_cast<double>(a) / b;
}

}  // namespace

double match_similarity(const MatchCounts& n, Similarity similarity) {
  const double kept = ratio(n.matches, n.reference_matches) + ratio(n.points, n.reference_points);
  if (similarity == Similarity::printed) return n.changed * kept;
  return std::max(n.reference_changed * kept / 2, 0.05 * n.matches);
}

double match_loss(const MatchCounts& n) {
  return 1 - ratio(n.matches, n.reference_matches);
}

double changed_excess(const MatchCounts& n) {
  return ratio(n.changed, n.matches) - 0.5;
}

double changed_growth(const MatchCounts& n) {
  return ratio(n.changed, n.matches) - ratio(n.reference_changed, n.reference_matches);
}

double changed_threshold(double theta, double alpha, double beta, double s, Similarity similarity) {
  if (similarity == Similarity::pks && theta < 0.1) return 1.1 * s;
  return (theta - beta - alpha) * s + s;
}

VisibilityVote vote_by_visibility(const MatchCounts& n, Similarity similarity) {
  VisibilityVote vote;
  vote.defined = n.matches > 0 && n.reference_matches > 0 && n.reference_points > 0;
  if (!vote.defined) return vote;
  vote.theta = match_loss(n);
  vote.alpha = changed_excess(n);
  vote.beta = changed_growth(n);
  vote.s = match_similarity(n, similarity);
  vote.threshold = changed_threshold(vote.theta, vote.alpha, vote.beta, vote.s, similarity);
  vote.votes = n.changed > vote.threshold;
  return vote;
}

}  // namespace dkb
