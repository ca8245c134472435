// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/keyframe_policy.h"

#include <fmt/format.h>

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
    case KeyframeRule::own:
      return "own";
    case KeyframeRule::none:
      break;
  }
  return "none";
}

const char* yes_or_no(bool yes) {
  return yes ? "yes" : "no";
}

std::string rule_of(const KeyframeDecision& decision) {
  std::string tests;
  if (decision.rule == KeyframeRule::floor)
    for (const auto& [spoke, name] :
         {std::pair{decision.tests.few_points, "few points"},
          std::pair{decision.tests.close_points, "few close points"}, std::pair{decision.tests.view_left, "view left"}})
      if (spoke) tests += (tests.empty() ? " (" : ", ") + std::string(name);
  return name_of(decision.rule) + tests + (tests.empty() ? "" : ")");
}

std::string explained(const KeyframeDecision& decision) {
  const std::string result = decision.insert ? fmt::format("keyframe ({})", name_of(decision.rule)) : "no keyframe";
  return result + ": " + decision.explanation;
}

void KeyframeTestCounts::add(const KeyframeTests& tests) {
  ++decisions;
  waited += tests.waited;
  parallax += tests.parallax;
  votes_asked += tests.votes_asked;
  visibility += tests.visibility;
  spread += tests.spread;
  few_points += tests.few_points;
  close_points += tests.close_points;
  view_left += tests.view_left;
}

std::map<std::string, int> KeyframeTestCounts::by_name() const {
  return {{"decisions", decisions},   {"waited", waited}, {"parallax", parallax},     {"votes_asked", votes_asked},
          {"visibility", visibility}, {"spread", spread}, {"few_points", few_points}, {"close_points", close_points},
          {"view_left", view_left}};
}

}  // namespace dkb
