// SPDX-License-Identifier: Apache-2.0
#include "report/run_report.h"

#include <fmt/format.h>

#include <limits>

#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"
#include "report/page_style.h"
#include "report/report_sections.h"

namespace dkb::report {

std::vector<Setting> changed_settings(const Options& options) {
  const std::string usual = Options().preset();
  std::vector<Setting> changed = options.settings();
  // An experiment that is set to its default may differ from the preset.
  std::erase_if(changed,
                [&](const Setting& s) { return s.value == s.initial && !options.experiments().contains(s.key); });
  if (options.preset() != usual) changed.insert(changed.begin(), {"preset", options.preset(), usual, ""});
  return changed;
}

void ReportFacts::take_map(const MapSnapshot& map) {
  for (const PointInfo& p : map.points())
    if (p.map == 0) map_points.push_back(p.position_in_world);
  for (const KeyframeInfo& k : map.keyframes())
    if (k.map == 0) keyframes.push_back(k.world_from_cam.translation);
}

Truth evaluated_by_truth(const std::string& source, const Trajectory& trajectory) {
  Truth truth;
  try {
    auto poses = truth_beside(source, &truth.hidden);
    if (!poses) return truth;
    truth.poses = std::move(*poses);
    if (!trajectory.empty()) truth.evaluation = evaluate(truth.poses, trajectory, {}, "trajectory.txt");
  } catch (const InputError& e) {
    truth.note = e.what();
  }
  return truth;
}

Context::Context(const RunLog& run_log, const ReportFacts& run_facts, const Truth& run_truth)
    : log(run_log), facts(run_facts), truth(run_truth) {
  const std::vector<FrameRow>& rows = log.rows();
  std::vector<int64_t> stamps;
  for (const FrameRow& r : rows) {
    stamps.push_back(r.stamp_ns);
    seconds.push_back(1e-9 * static_cast<double>(r.stamp_ns - rows.front().stamp_ns));
  }
  fps = facts.camera.fps > 0 ? facts.camera.fps : frame_rate_of(stamps);
  if (!seconds.empty()) duration = std::max(seconds.back(), 1 / fps);
  stretches = lost_stretches(rows, facts.limits);
  for (const LostStretch& s : stretches) {
    const double end = s.end < seconds.size() ? seconds[s.end] : duration;
    if (!bands.empty() && seconds[s.begin] - bands.back().end < least_gap(duration))
      bands.back().end = end;
    else
      bands.push_back({seconds[s.begin], end, name_of(s.state)});
  }
  error_m.assign(rows.size(), std::numeric_limits<double>::quiet_NaN());
  if (!truth.evaluation) return;
  const Evaluation& e = *truth.evaluation;
  for (size_t i = 0; i < e.timestamps.size(); ++i)
    if (const size_t row = row_of(e.timestamps[i]); row < rows.size()) error_m[row] = e.ape.translation_m[i];
}

double Context::seconds_of(double timestamp) const {
  return timestamp - seconds_from_ns(log.rows().front().stamp_ns);
}

size_t Context::row_of(double timestamp) const {
  const double at = seconds_of(timestamp);
  const auto it = std::lower_bound(seconds.begin(), seconds.end(), at - 1e-5);
  return it != seconds.end() && *it < at + 1e-5 ? static_cast<size_t>(it - seconds.begin()) : seconds.size();
}

std::string metres(double value) {
  return fmt::format("{:.{}f} m", value, value < 0.1 ? 4 : value < 1 ? 3 : value < 10 ? 2 : 1);
}

std::string when(const Context& c, size_t row) {
  return fmt::format("frame {}, {:.2f} s", row, c.seconds[row]);
}

std::string report_html(const RunLog& log, const ReportFacts& facts, const Truth& truth) {
  const Context c(log, facts, truth);
  const bool any = !log.rows().empty();
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\"/>\n<meta http-equiv=\"Content-Security-Policy\" "
      "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\"/>\n<title>Run: " +
      svg::escaped(facts.name) + "</title>\n<style>" + kPageStyle + "</style>\n</head>\n<body>\n";
  std::string sections;
  if (any) {
    sections = lost_section(c) + path_section(c) + map_section(c) + time_section(c) + tracking_section(c) +
               pictures_section(c) + stages_section(c) + events_section(c);
  }
  sections += settings_section(c);
  return out + verdict(c, sections) + sections + "</body>\n</html>\n";
}

}  // namespace dkb::report
