// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "dkb/keyframes/keyframe_policy.h"

namespace dkb {
namespace {

// As published with ORB-SLAM2 for RGB-D cameras.
constexpr int kFewClose = 100;      // [points] fewer tracked close points ...
constexpr int kManyCreatable = 70;  // [points] ... while at least so many could be made call for a keyframe

}  // namespace

BaselineKeyframePolicy::BaselineKeyframePolicy(BaselineKeyframeOptions options) : options_(options) {}

KeyframeDecision BaselineKeyframePolicy::decide(const KeyframeContext& q, const Map&) {
  const bool settled = q.frame - q.last_relocalisation_frame > options_.frames_between;
  KeyframeDecision decision;
  KeyframeTests& tests = decision.tests;
  tests.waited = q.mapper_idle || q.frame - q.last_keyframe_frame > options_.frames_between;
  tests.few_points = q.tracked_points < options_.min_tracked;
  tests.view_left = q.tracked_points < options_.reference_ratio * q.reference_points;
  tests.close_points = q.tracked_close_points < kFewClose && q.creatable_close_points >= kManyCreatable;
  decision.insert = settled && tests.waited && !tests.few_points && (tests.view_left || tests.close_points);
  decision.rule = decision.insert ? KeyframeRule::baseline : KeyframeRule::none;
  if (!q.explain) return decision;
  decision.explanation = fmt::format(
      "tracked {} (at least {}: {}) against {} of the reference's {}: {}; close {} (+{}): {}; {} frames since the last "
      "keyframe, mapper {}: {}; settled since a relocalisation: {}",
      q.tracked_points, options_.min_tracked, yes_or_no(!tests.few_points), options_.reference_ratio,
      q.reference_points, yes_or_no(tests.view_left), q.tracked_close_points, q.creatable_close_points,
      yes_or_no(tests.close_points), q.frame - q.last_keyframe_frame, q.mapper_idle ? "idle" : "busy",
      yes_or_no(tests.waited), yes_or_no(settled));
  return decision;
}

}  // namespace dkb
