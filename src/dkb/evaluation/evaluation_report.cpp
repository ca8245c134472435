// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/evaluation_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace dkb {
namespace {

constexpr size_t kFewPairs = 10;

std::string table_row(const char* name, const char* unit, const ErrorStatistics& s, int decimals,
                      const char* why_none = "no pair of poses is that far apart") {
  if (s.count == 0) return fmt::format("{:<17}{:>4}   {}\n", name, unit, why_none);
  return fmt::format("{:<17}{:>4} {:>10.{}f} {:>10.{}f} {:>10.{}f} {:>10.{}f} {:>10.{}f} {:>10.{}f}\n", name, unit,
                     s.rmse, decimals, s.mean, decimals, s.median, decimals, s.std, decimals, s.min, decimals, s.max,
                     decimals);
}

nlohmann::ordered_json statistics_json(const ErrorStatistics& s) {
  const auto value = [&](double x) { return s.count == 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(x); };
  return {{"rmse", value(s.rmse)}, {"mean", value(s.mean)}, {"median", value(s.median)},
          {"std", value(s.std)},   {"min", value(s.min)},   {"max", value(s.max)}};
}

nlohmann::ordered_json errors_json(const PoseErrors& e) {
  return {{"translation_m", statistics_json(e.translation)}, {"rotation_deg", statistics_json(e.rotation)}};
}

}  // namespace

std::string evaluation_table(const Evaluation& e) {
  std::string alignment;  // where it is not the usual one
  if (e.options.alignment == Alignment::sim3) alignment = fmt::format(", scale {:.6f}", e.truth_from_estimate.scale);
  if (e.options.alignment == Alignment::origin) alignment = ", aligned by the first pose alone";
  if (e.options.alignment == Alignment::none) alignment = ", not aligned";
  std::string out =
      fmt::format("{} poses matched ({} estimated, {} true, stamps within {} s{})\n", e.ape.translation_m.size(),
                  e.estimated_poses, e.truth_poses, e.options.max_difference, alignment);
  out += fmt::format("{:<21} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "", "rmse", "mean", "median", "std", "min",
                     "max");
  out += table_row("APE translation", "m", e.ape.translation, 6);
  out += table_row("APE rotation", "deg", e.ape.rotation, 4,
                   "not determined: a path lies on a line or in one place, which can be turned about itself");
  const std::string rpe = "RPE " + to_string(e.options.rpe_delta);
  out += table_row((rpe + " transl.").c_str(), "m", e.rpe.translation, 6);
  out += table_row((rpe + " rotation").c_str(), "deg", e.rpe.rotation, 4);
  // A short clip, or one that hardly moves.
  if (e.rotation_determined() && e.rotation_sd_deg > 0 && e.rotation_sd_deg >= e.ape.rotation.rmse)
    out += fmt::format("APE rotation may be the alignment's alone: the positions tell it to +- {:.2g} deg\n",
                       e.rotation_sd_deg);
  if (!e.rpe_pairs.empty())
    out += fmt::format("{} of {} pairs of poses{}\n", rpe, e.rpe_pairs.size(),
                       e.options.rpe_all_pairs ? ", all that are so far apart" : "");
  return out;
}

std::vector<std::string> evaluation_warnings(const Evaluation& e) {
  std::vector<std::string> warnings;
  if (e.wrong_scale) warnings.push_back(scale_text(*e.wrong_scale));
  if (!e.rpe_pairs.empty() && e.rpe_pairs.size() < kFewPairs)
    warnings.push_back(fmt::format("RPE {}: {} pairs of poses tell little; take a shorter stretch{}",
                                   to_string(e.options.rpe_delta), e.rpe_pairs.size(),
                                   e.options.rpe_all_pairs ? "" : ", or all pairs with --rpe-all-pairs"));
  return warnings;
}

std::string scale_text(double wrong_scale) {
  return fmt::format("the estimate is {:.4g} times too {} for the truth; is the depth factor right?",
                     std::max(wrong_scale, 1 / wrong_scale), wrong_scale > 1 ? "small" : "large");
}

std::string evaluation_json(const Evaluation& e) {
  nlohmann::ordered_json json;
  json["matched"] = e.ape.translation_m.size();
  json["estimated"] = e.estimated_poses;
  json["align"] = name_of(e.options.alignment);
  json["scale"] = e.truth_from_estimate.scale;
  if (e.wrong_scale) json["wrong_scale"] = *e.wrong_scale;
  json["ape"] = errors_json(e.ape);
  json["ape"]["rotation_determined"] = e.rotation_determined();
  if (e.rotation_determined()) json["ape"]["rotation_sd_deg"] = e.rotation_sd_deg;
  json["rpe"] = errors_json(e.rpe);
  json["rpe"]["delta"] = to_string(e.options.rpe_delta);
  json["rpe"]["pairs"] = e.rpe_pairs.size();
  json["rpe"]["all_pairs"] = e.options.rpe_all_pairs;
  return json.dump(2) + "\n";
}

}  // namespace dkb
