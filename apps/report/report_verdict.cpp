// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/plural.h"
#include "report/other_maps.h"
#include "report/report_sections.h"

namespace dkb::report {
namespace {

std::string tile(const char* style, const std::string& name, const std::string& value, const std::string& more) {
  return fmt::format(
      "<div class=\"tile{}\"><div class=\"name\">{}</div><div class=\"value\">{}</div><div "
      "class=\"more\">{}</div></div>\n",
      style, name, value, more);
}

std::string clocked(const std::string& html) {
  return "<!--clock-->" + html + "<!--/clock-->";
}

std::string headline(const Context& c) {
  const Statistics& s = c.facts.statistics;
  if (s.tracked == 0) return "No frame has a pose";
  std::string out = s.tracked == c.facts.offered
                        ? "All " + plural(s.tracked, "frame has a pose", "frames have a pose")
                        : fmt::format("{} of {} frames have a pose", s.tracked, c.facts.offered);
  const std::string others = other_maps_text(c.facts.poses_of_map);
  if (!others.empty()) out += "; " + others;
  if (!c.truth.evaluation) return out;
  const ErrorStatistics& ape = c.truth.evaluation->ape.translation;
  if (!others.empty())
    return out + fmt::format("; of the others {} are {} rmse from the truth", ape.count, metres(ape.rmse));
  return out + ", " + metres(ape.rmse) + " rmse from the truth";
}

// Frames without a pose, by their cause.
std::string why_lost(const Context& c, TrackingState state) {
  std::vector<std::pair<std::string, size_t>> causes;
  for (const LostStretch& s : c.stretches) {
    if (s.state != state) continue;
    for (const LostPart& part : s.parts) {
      auto it =
          std::find_if(causes.begin(), causes.end(), [&](const auto& known) { return known.first == part.cause; });
      if (it == causes.end()) it = causes.insert(it, {part.cause, 0});
      it->second += part.end - part.begin;
    }
  }
  std::stable_sort(causes.begin(), causes.end(), [](auto& a, auto& b) { return a.second > b.second; });
  std::string out;
  for (const auto& [cause, frames] : causes)
    out +=
        fmt::format("{}{} ({})", out.empty() ? "" : ", ", cause, plural(static_cast<long>(frames), "frame", "frames"));
  return out;
}

// Where the time of the run went, in three parts that add up, and the largest piece of the largest of them.
std::string what_limited(const Context& c, double tracking_s, double waiting_s) {
  const auto& stages = c.facts.statistics.stages;
  const auto total = [&](const std::string& name) {
    const auto it = stages.find(name);
    return it == stages.end() ? 0.0 : 1e-3 * it->second.mean_ms * static_cast<double>(it->second.count);
  };
  const auto largest = [&](std::initializer_list<const char*> names) {
    const char* best = *names.begin();
    for (const char* name : names)
      if (total(name) > total(best)) best = name;
    return std::string(best);
  };
  const double wall = std::max(c.facts.wall_s, 1e-9), rest = std::max(0.0, wall - tracking_s - waiting_s);
  const auto share = [&](double s) { return fmt::format("{:.0f} %", 100 * s / wall); };
  if (waiting_s > tracking_s && waiting_s > rest)
    return "waiting for " +
           std::string(largest({"wait_mapper", "wait_detector"}) == "wait_mapper" ? "mapping" : "the detector") + ": " +
           share(waiting_s) + " of the time";
  if (rest > tracking_s)
    return fmt::format("{} ({} of the time)", c.facts.realtime ? "the camera's pace" : "reading the images",
                       share(rest));
  // Stages that tracking itself consists of; what is left of it is the pose. The page (web/src/charts.ts) has the same.
  const auto parts = {"features", "motion", "flow", "filter", "keyframe_decision"};
  const std::string stage = largest(parts);
  double known = 0;
  for (const char* part : parts) known += total(part);
  const bool pose = tracking_s - known > total(stage);
  return fmt::format("tracking ({} of the time; {} alone {})", share(tracking_s),
                     pose                           ? "the pose"
                     : stage == "keyframe_decision" ? "keyframe decisions"
                                                    : stage,
                     share(pose ? tracking_s - known : total(stage)));
}

std::string speed_tile(const Context& c) {
  double tracking_s = 0, waiting_s = 0;
  for (const FrameRow& r : c.log.rows()) tracking_s += 1e-3 * r.tracking_ms, waiting_s += 1e-3 * r.waiting_ms;
  const double factor = (c.seconds.empty() ? 0 : c.seconds.back() + 1 / c.fps) / std::max(c.facts.wall_s, 1e-9);
  const bool keeps_up = c.facts.realtime ? c.facts.skipped == 0 : factor >= 1;
  return clocked(tile(keeps_up ? " good" : " bad", "Real-time factor",
                      fmt::format("<span id=\"realtime\">{:.2f}</span> ×", factor),
                      (c.facts.realtime ? "paced by the stamps; " : "") + std::string("limited by ") +
                          what_limited(c, tracking_s, waiting_s)));
}

}  // namespace

std::string verdict(const Context& c, const std::string& sections) {
  const Statistics& s = c.facts.statistics;
  const int unstarted = s.frames - s.tracked - s.lost;
  std::string out = "<header>\n<div class=\"dim\">Report of a run · dkb-slam " + svg::escaped(c.facts.version) +
                    "</div>\n<h1>" + headline(c) + "</h1>\n<div class=\"dim\">" +
                    svg::escaped(c.facts.name + ": " + c.facts.source) + "</div>\n<nav>";
  for (const auto& [id, name] :
       {std::pair{"lost", "Lost"}, std::pair{"path", "Path"}, std::pair{"map", "Map"}, std::pair{"time", "Over time"},
        std::pair{"tracking", "Tracking"}, std::pair{"pictures", "Pictures"}, std::pair{"stages", "Times"},
        std::pair{"events", "Events"}, std::pair{"settings", "Settings"}}) {
    if (sections.find(fmt::format("<h2 id=\"{}\">", id)) != std::string::npos)
      out += fmt::format("<a href=\"#{}\">{}</a> ", id, name);
  }
  out += "</nav>\n</header>\n<main>\n<div class=\"tiles\">\n";
  std::string more = fmt::format("{:.1f} %", c.facts.offered > 0 ? 100.0 * s.tracked / c.facts.offered : 0.0);
  if (c.facts.skipped > 0) more += "; " + plural(c.facts.skipped, "frame", "frames") + " skipped";
  if (unstarted > 0) more += "; " + plural(unstarted, "frame", "frames") + " before the first map";
  out += tile(
      s.tracked == c.facts.offered ? " good" : " bad", "Tracked",
      fmt::format("<span id=\"tracked\">{}</span> of <span id=\"frames\">{}</span>", s.tracked, c.facts.offered), more);
  out += tile(s.lost == 0 ? " good" : " bad", "Lost", fmt::format("<span id=\"lost-frames\">{}</span>", s.lost),
              s.lost == 0 ? "no frame" : why_lost(c, TrackingState::lost));
  if (s.predicted > 0)
    out += tile("", "Predicted", fmt::format("<span id=\"predicted\">{}</span>", s.predicted),
                "by a motion prior or depth alone: " + why_lost(c, TrackingState::predicted));
  if (c.truth.evaluation) {
    const PoseErrors& ape = c.truth.evaluation->ape;
    out +=
        tile(" good", "APE, rmse", fmt::format("<span id=\"ape\">{:.4f}</span> m", ape.translation.rmse),
             fmt::format("{}median {:.4f} m, largest {:.4f} m · {} poses",
                         c.truth.evaluation->rotation_determined() ? fmt::format("{:.2f}° · ", ape.rotation.rmse) : "",
                         ape.translation.median, ape.translation.max, ape.translation.count));
  }
  if (!c.log.rows().empty()) out += speed_tile(c);
  out += tile("", "Map", plural(s.keyframes, "keyframe", "keyframes"),
              fmt::format("{} points · {}{}", s.map_points, plural(s.loops, "loop", "loops"),
                          s.maps > 1 ? fmt::format(" · {} maps that were never joined", s.maps) : ""));
  const auto rows = static_cast<double>(std::max<size_t>(1, c.log.rows().size()));
  out += tile("", "Kept out as moving", fmt::format("{:.1f} a frame", static_cast<double>(s.features_removed) / rows),
              fmt::format("features; detector: {}", svg::escaped(s.detector)));
  out += "</div>\n";
  if (!c.truth.note.empty()) out += "<p>No error is given: " + svg::escaped(c.truth.note) + "</p>\n";
  return out;
}

}  // namespace dkb::report
