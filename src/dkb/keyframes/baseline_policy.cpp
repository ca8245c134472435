// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "dkb/keyframes/keyframe_policy.h"

namespace dkb {
namespace {

constexpr int kFramesBetween = 20;  // [frames] longest wait while mapping is busy; also that after a relocalisation
constexpr int kMinTracked = 50;     // [points] with fewer tracked no keyframe is made
// Of the reference keyframe's points: with fewer tracked its view is left. Published: 0.9, for another matcher; with
// ours 0.85 gives as many keyframes as ORB-SLAM3 makes (35 to 39 on fr1_xyz's first 9 s).
constexpr double kReferenceRatio = 0.85;

}  // namespace

KeyframeDecision BaselineKeyframePolicy::decide(const KeyframeContext& q, const Map&) {
  const bool settled = q.frame - q.last_relocalisation_frame > kFramesBetween;
  KeyframeDecision decision;
  KeyframeTests& tests = decision.tests;
  tests.waited = q.mapper_idle || q.frame - q.last_keyframe_frame > kFramesBetween;
  tests.few_points = q.tracked_points < kMinTracked;
  tests.view_left = q.tracked_points < kReferenceRatio * q.reference_points;
  tests.close_points = q.tracked_close_points < kFewClose && q.creatable_close_points >= kManyCreatable;
  decision.insert = settled && tests.waited && !tests.few_points && (tests.view_left || tests.close_points);
  decision.rule = decision.insert ? KeyframeRule::baseline : KeyframeRule::none;
  if (!q.explain) return decision;
  decision.explanation = fmt::format(
      "tracked {} (at least {}: {}) against {} of the reference's {}: {}; close {} (+{}): {}; {} frames since the last "
      "keyframe, mapper {}: {}; settled since a relocalisation: {}",
      q.tracked_points, kMinTracked, yes_or_no(!tests.few_points), kReferenceRatio, q.reference_points,
      yes_or_no(tests.view_left), q.tracked_close_points, q.creatable_close_points, yes_or_no(tests.close_points),
      q.frame - q.last_keyframe_frame, q.mapper_idle ? "idle" : "busy", yes_or_no(tests.waited), yes_or_no(settled));
  return decision;
}

}  // namespace dkb
