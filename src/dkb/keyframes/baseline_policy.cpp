// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/util/errors.h"

namespace dkb {

const char* name_of(KeyframeRule rule) {
  switch (rule) {
    case KeyframeRule::first:
      return "first";
    case KeyframeRule::baseline:
      return "baseline";
    case KeyframeRule::adaptive:
      return "adaptive";
    case KeyframeRule::floor:
      return "floor";
    case KeyframeRule::none:
      break;
  }
  return "none";
}

void BaselineKeyframeOptions::check() const {
  require_option(frames_between >= 1, "frames_between", frames_between, "at least 1 frame");
  require_option(least_tracked >= 0, "least_tracked", least_tracked, "at least 0");
  require_option(reference_ratio >= 0 && reference_ratio <= 1, "reference_ratio", reference_ratio, "0 ... 1");
  require_option(few_close >= 0, "few_close", few_close, "at least 0");
  require_option(many_creatable >= 0, "many_creatable", many_creatable, "at least 0");
}

BaselineKeyframePolicy::BaselineKeyframePolicy(BaselineKeyframeOptions options) : options_(options) {
  options_.check();
}

KeyframeDecision BaselineKeyframePolicy::decide(const KeyframeQuery& q, const Map&) {
  const bool settled = q.frame - q.last_relocalisation_frame > options_.frames_between;
  const bool waited = q.mapper_idle || q.frame - q.last_keyframe_frame > options_.frames_between;
  const bool enough = q.tracked_points >= options_.least_tracked;
  const bool view_left = q.tracked_points < options_.reference_ratio * q.reference_points;
  const bool close_call =
      q.tracked_close_points < options_.few_close && q.creatable_close_points >= options_.many_creatable;
  KeyframeDecision decision;
  decision.insert = settled && waited && enough && (view_left || close_call);
  decision.rule = decision.insert ? KeyframeRule::baseline : KeyframeRule::none;
  decision.explanation = "tracked " + std::to_string(q.tracked_points) + " against the reference's " +
                         std::to_string(q.reference_points) + ", close " + std::to_string(q.tracked_close_points) +
                         " (+" + std::to_string(q.creatable_close_points) + "), mapper " +
                         (q.mapper_idle ? "idle" : "busy");
  return decision;
}

}  // namespace dkb
