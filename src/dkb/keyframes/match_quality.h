// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

// Which similarity S (DKB eq. 34) is compared with. The paper's text prints n_diff in it, where the source of the idea
// (PKS: Azimi et al., ISPRS J. 191, 2022) has n_diffr and a half.
enum class Similarity { printed, pks };

// A frame against the last keyframe. The reference frame is the first one after that keyframe.
struct MatchCounts {
  int matches = 0;            // n_matches: map points of the frame that the keyframe shows too
  int changed = 0;            // n_diff: of these, with another visibility level than in the keyframe
  int points = 0;             // m: all map points of the frame
  int reference_matches = 0;  // r: the reference frame's matches with the keyframe
  int reference_changed = 0;  // n_diffr: of these, with another level
  int reference_points = 0;   // C: all map points of the reference frame
};

// DKB eq. 34 as printed: n_diff n_matches / r + n_diff m / C; with `pks` half of the same with n_diffr, at least
// 0.05 n_matches, since n_diffr is often 0 one frame after a keyframe. r and C must not be 0.
double match_similarity(const MatchCounts& n, Similarity similarity);

double match_loss(const MatchCounts& n);      // theta, DKB eq. 35: 1 - n_matches / r; r must not be 0
double changed_excess(const MatchCounts& n);  // alpha, DKB eq. 36: n_diff / n_matches - 0.5; n_matches must not be 0
double changed_growth(const MatchCounts& n);  // beta, DKB eq. 37: n_diff / n_matches - n_diffr / r; neither may be 0

// DKB eq. 33 with the signs restored: (theta - beta - alpha) S + S. With `pks` and theta < 0.1 it is 1.1 S.
double changed_threshold(double theta, double alpha, double beta, double s, Similarity similarity);

struct VisibilityVote {
  bool defined = false;  // false: r, C or n_matches is 0, the frame has no vote
  double theta = 0, alpha = 0, beta = 0, s = 0, threshold = 0;
  bool votes = false;  // for a keyframe: n_diff > threshold
};

VisibilityVote vote_by_visibility(const MatchCounts& counts, Similarity similarity);

}  // namespace dkb
