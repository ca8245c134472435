// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/util/errors.h"

namespace dkb {

void BaselineKeyframeOptions::check() const {
  require_option(frames_between >= 1, "frames_between", frames_between, "at least 1 frame");
  require_option(min_tracked >= 0, "min_tracked", min_tracked, "at least 0");
  require_option(reference_ratio >= 0 && reference_ratio <= 1, "reference_ratio", reference_ratio, "0 ... 1");
  require_option(few_close >= 0, "few_close", few_close, "at least 0");
  require_option(many_creatable >= 0, "many_creatable", many_creatable, "at least 0");
}

BaselineKeyframePolicy::BaselineKeyframePolicy(BaselineKeyframeOptions options) : options_(options) {
  options_.check();
}

KeyframeDecision BaselineKeyframePolicy::decide(const KeyframeQuery& q, const Map&) {
  const bool settled = q.frame - q.last_relocalisation_frame > options_.frames_between;
  KeyframeDecision decision;
  KeyframeTests& tests = decision.tests;
  tests.waited = q.mapper_idle || q.frame - q.last_keyframe_frame > options_.frames_between;
  tests.few_points = q.tracked_points < options_.min_tracked;
  tests.view_left = q.tracked_points < options_.reference_ratio * q.reference_points;
  tests.close_points =
      q.tracked_close_points < options_.few_close && q.creatable_close_points >= options_.many_creatable;
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
