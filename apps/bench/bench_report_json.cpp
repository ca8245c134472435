// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "bench/bench_report.h"

namespace dkb::bench {
namespace {

using Json = nlohmann::ordered_json;

Json interval_json(const MedianInterval& m) {
  Json j;
  j["median"] = std::isfinite(m.median) ? Json(m.median) : Json();
  j["interval_95"] = m.known ? Json({m.interval.low, m.interval.high}) : Json();
  return j;
}

}  // namespace

std::string results_json(const Results& r, const ReportOptions& options) {
  Json j;
  j["suite"] = r.suite->name;
  j["hash"] = suite_hash(*r.suite);
  j["seeds"] = r.suite->seeds;
  j["cells"] = Json::array();
  for (const Cell& c : r.cells) {
    Json cell;
    cell["sequence"] = r.suite->sequences[c.sequence].name;
    cell["variant"] = r.suite->variants[c.variant].name;
    cell["not_run"] = c.not_run;
    cell["published_ape_m"] = c.published ? Json(*c.published) : Json();
    const std::vector<double> ape = c.ape();
    cell["ape_m"] = interval_json(median_interval(ape));
    cell["ape_m"]["worst"] = ape.empty() ? Json() : Json(*std::max_element(ape.begin(), ape.end()));
    const auto median = [](const std::vector<double>& values) {
      return values.empty() ? Json() : Json(median_of(values));
    };
    cell["ape_std_m"] = median(c.figures(&RunRecord::ape, &Scores::translation_m, &ErrorStatistics::std));
    cell["rpe_m"] = median(c.figures(&RunRecord::rpe, &Scores::translation_m, &ErrorStatistics::rmse));
    cell["rpe_deg"] = median(c.figures(&RunRecord::rpe, &Scores::rotation_deg, &ErrorStatistics::rmse));
    cell["scored_share"] = ape.empty() ? Json() : Json(c.scored());
    cell["runs"] = Json::array();
    for (const auto* runs : {&c.finished, &c.failed})
      for (const RunRecord& run : *runs) {
        Json record = Json::parse(record_json(run));
        if (!options.times) record.erase("machine");
        cell["runs"].push_back(record);
      }
    j["cells"].push_back(cell);
  }
  j["comparisons"] = Json::array();
  for (const Comparison& c : r.comparisons) {
    Json row = {{"variant", c.variant},
                {"reference", r.suite->reference},
                {"sequences", c.sequences},
                {"runs_left_out", c.left_out}};
    row["ratio"] = interval_json(c.ratio);
    if (c.sequences == 0) row["ratio"]["median"] = nullptr;
    row["better"] = c.better;
    row["worse"] = c.worse;
    row["uneven"] = Json::array();
    for (const Comparison::Uneven& u : c.uneven)
      row["uneven"].push_back(
          {{"sequence", u.sequence}, {"scored_share", u.ours}, {"reference_scored_share", u.reference}});
    j["comparisons"].push_back(row);
  }
  if (r.suite->sweep) {
    j["sweep"] = {{"setting", r.suite->sweep->setting}, {"values", r.suite->sweep->values}};
    j["sweep"]["sequences"] = Json::array();
    for (const SweepResult& s : r.sweep) {
      Json row = {{"sequence", s.sequence},
                  {"runs", s.runs},
                  {"best", r.suite->sweep->values[s.best]},
                  {"p_value", s.p_value},
                  {"exceeds_noise", s.exceeds_noise}};
      row["ape_m"] = Json::array();
      for (const MedianInterval& m : s.ape) row["ape_m"].push_back(interval_json(m));
      j["sweep"]["sequences"].push_back(row);
    }
    j["sweep"]["sentences"] = sweep_sentences(r);
  }
  return j.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace dkb::bench
