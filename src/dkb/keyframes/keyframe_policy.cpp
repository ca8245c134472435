// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/keyframe_policy.h"

#include <fmt/format.h>

#include <utility>

namespace dkb {
namespace {

constexpr std::pair<const char*, bool KeyframeTests::*> kTests[] = {{"waited", &KeyframeTests::waited},
                                                                    {"parallax", &KeyframeTests::parallax},
                                                                    {"votes_asked", &KeyframeTests::votes_asked},
                                                                    {"visibility", &KeyframeTests::visibility},
                                                                    {"spread", &KeyframeTests::spread},
                                                                    {"few_points", &KeyframeTests::few_points},
                                                                    {"close_points", &KeyframeTests::close_points},
                                                                    {"view_left", &KeyframeTests::view_left}};

}  // namespace

const char* name_of(KeyframeRule rule) {
  static constexpr const char* names[] = {"none", "first", "baseline", "adaptive", "floor", "own"};
  return names[static_cast<size_t>(rule)];
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

KeyframeTestCounts::KeyframeTestCounts() : by_name_{{"decisions", 0}} {
  for (const auto& [name, test] : kTests) by_name_[name] = 0;
}

void KeyframeTestCounts::add(const KeyframeTests& tests) {
  ++by_name_["decisions"];
  for (const auto& [name, test] : kTests) by_name_[name] += tests.*test;
}

}  // namespace dkb
