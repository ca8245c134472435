// SPDX-License-Identifier: Apache-2.0
#include "report/report_sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/plural.h"
#include "dkb/util/stamps.h"

namespace dkb::report {
namespace {

std::string heading(const char* id, const char* title) {
  return fmt::format("<h2 id=\"{}\">{}</h2>\n", id, title);
}
std::string spaced(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}
std::string figure(const std::string& svg) {
  return "<figure>" + svg + "</figure>\n";
}

// "Frames 20 to 22, 2.00 to 2.20 s: 3 frames".
std::string frames_text(const Context& c, size_t begin, size_t end) {
  return fmt::format("Frames {} to {}, {:.2f} to {:.2f} s: {}", begin, end - 1, c.seconds[begin], c.seconds[end - 1],
                     plural(static_cast<long>(end - begin), "frame", "frames"));
}

// A value of each row that has a pose by the images.
template <class Value>
Line line_of(const Context& c, const char* style, const char* name, Value value) {
  Line line{style, name, {}, {}, {}};
  for (size_t i = 0; i < c.log.rows().size(); ++i)
    if (const double v = value(i); std::isfinite(v)) line.add(c.seconds[i], v, i);
  return line;
}

// A point of the first map in the truth's world, or in its own.
Eigen::Vector3d drawn(const Context& c, const Eigen::Vector3d& point) {
  return c.truth.evaluation ? c.truth.evaluation->truth_from_estimate * point : point;
}

UpAxis up_where_drawn(const Context& c) {
  if (c.truth.evaluation) return up_axis(c.truth.evaluation->truth);
  std::vector<Rigid3> poses;
  for (const StampedPose& p : c.facts.trajectory) poses.push_back(p.world_from_cam);
  return up_axis(poses);
}

// The truth's poses during the run.
Trajectory truth_during_run(const Context& c) {
  Trajectory during;
  if (!c.truth.evaluation) return during;
  for (const StampedPose& p : c.truth.poses)
    if (const double s = c.seconds_of(p.timestamp); s >= -1e-3 && s <= c.duration + 1e-3) during.push_back(p);
  return during;
}

// In the first map's world.
SpacePath estimated_path(const Context& c) {
  SpacePath path{"est", "estimate (dot: start)", {}, {}};
  size_t last = 0;
  for (const StampedPose& p : c.facts.trajectory) {
    const size_t row = std::min(c.row_of(p.timestamp), c.seconds.size() - 1);
    if (path.points.empty() || (row != last + 1 && c.seconds[row] - c.seconds[last] > least_gap(c.duration)))
      path.starts.push_back(path.points.size());
    last = row;
    path.points.push_back(p.world_from_cam.translation);
  }
  return path;
}

}  // namespace

std::string path_section(const Context& c) {
  if (c.facts.trajectory.empty()) return "";
  std::vector<SpacePath> paths;
  if (c.truth.evaluation) {
    SpacePath truth{"truth", "truth", {}, {0}};
    for (const StampedPose& p : truth_during_run(c)) truth.points.push_back(p.world_from_cam.translation);
    paths.push_back(std::move(truth));
  }
  paths.push_back(estimated_path(c));
  for (Eigen::Vector3d& p : paths.back().points) p = drawn(c, p);
  std::string out = heading("path", "Path") + "<div class=\"grid three\">\n";
  for (const std::string& view : path_views(paths, up_where_drawn(c))) out += figure(view);
  out += "</div>\n";
  if (c.facts.statistics.maps > 1)
    out += "<p class=\"dim\">Of the first map alone; the others have worlds of their own.</p>\n";
  return out;
}

std::string map_section(const Context& c) {
  if (c.facts.trajectory.empty() || c.facts.map_points.empty()) return "";
  const std::pair<int, int> axes = axes_from_above(up_where_drawn(c));
  const auto above = [&](std::vector<Eigen::Vector3d> points) {
    for (Eigen::Vector3d& p : points) p = drawn(c, p), p = Eigen::Vector3d(p[axes.first], p[axes.second], 0);
    return points;
  };
  const SpacePath path = estimated_path(c);
  MapAbove map{std::string(1, "xyz"[axes.first]) + " [m]", std::string(1, "xyz"[axes.second]) + " [m]",
               above(c.facts.map_points), above(c.facts.keyframes), path};
  map.path.points = above(path.points);
  std::string out = heading("map", "Map") + "<div class=\"grid maps\">\n" + figure(map_above(map));
  if (c.facts.grid) {
    SpacePath on_floor = path;
    for (Eigen::Vector3d& p : on_floor.points) p = c.facts.grid->floor_from_world * p;
    out += figure(grid_above(*c.facts.grid, on_floor));
  }
  return out + "</div>\n";
}

std::string time_section(const Context& c) {
  if (c.facts.trajectory.empty()) return "";
  const Trajectory truth = truth_during_run(c);
  std::string out = heading("time", "Position over time") + "<div class=\"grid\">\n";
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    TimeChart chart{std::string(1, "xyz"[axis]), "[m]", {}};
    if (!truth.empty()) {
      Line line{"truth", "truth", {}, {}, {}};
      for (size_t i = 0; i < truth.size(); ++i)
        line.add(c.seconds_of(truth[i].timestamp), truth[i].world_from_cam.translation[axis], i);
      chart.lines.push_back(std::move(line));
    }
    Line line{"est", "estimate", {}, {}, {}};
    for (const StampedPose& p : c.facts.trajectory)
      line.add(c.seconds_of(p.timestamp), drawn(c, p.world_from_cam.translation)[axis], c.row_of(p.timestamp));
    chart.lines.push_back(std::move(line));
    out += figure(time_chart(chart, c.duration, c.bands));
  }
  if (c.truth.evaluation) {
    TimeChart chart{"Error of the position",
                    "[m]",
                    {line_of(c, "error", "distance from the truth", [&](size_t i) { return c.error_m[i]; })},
                    true};
    chart.levels.push_back({c.truth.evaluation->ape.translation.rmse, "rmse"});
    out += figure(time_chart(chart, c.duration, c.bands));
  } else {
    const auto sd = [&](size_t i) {
      const FrameRow& r = c.log.rows()[i];
      return r.position_sd > 0 ? r.position_sd : std::nan("");
    };
    out +=
        figure(time_chart({"Uncertainty of the position", "[m]", {line_of(c, "error", "standard deviation", sd)}, true},
                          c.duration, c.bands));
  }
  return out + "</div>\n";
}

std::string lost_section(const Context& c) {
  constexpr size_t kShown = 30, kParts = 6;
  std::string out = heading("lost", "Where the images told no pose");
  if (c.stretches.empty()) return out + "<p>Nowhere: every frame was tracked by its images.</p>\n";
  out += "<p>Shaded in all charts below. The likely causes are what the frames of a stretch were like.</p>\n";
  size_t shown = 0;
  for (const LostStretch& s : c.stretches) {
    if (++shown > kShown) break;
    const auto& pictures = c.log.lost();
    const auto picture =
        std::find_if(pictures.begin(), pictures.end(), [&](const auto& p) { return p.row == s.begin; });
    const bool bare = picture == pictures.end();
    const char* what = s.state == TrackingState::lost        ? "lost"
                       : s.state == TrackingState::predicted ? "bridged by a motion prior or depth"
                                                             : "before the first map";
    out += fmt::format("<div class=\"stretch{}\">", bare ? " bare" : "");
    if (!bare) out += figure(overlay_svg(*picture, "First frame of the stretch"));
    out += "<div>";
    for (size_t k = 0; k < std::min(kParts, s.parts.size()); ++k) {
      const LostPart& part = s.parts[k];
      out += fmt::format("<p class=\"cause\">{}</p><p>{}.</p>", part.cause, part.evidence);
      if (s.parts.size() > 1) out += "<p class=\"dim\">" + frames_text(c, part.begin, part.end) + "</p>";
    }
    if (s.parts.size() > kParts) out += fmt::format("<p>And {} parts more.</p>", s.parts.size() - kParts);
    out += fmt::format("<p class=\"dim\">{} {}.</p></div></div>\n",
                       s.parts.size() == 1 ? frames_text(c, s.begin, s.end)
                                           : "In all: " + plural(static_cast<long>(s.end - s.begin), "frame", "frames"),
                       what);
  }
  if (c.stretches.size() > kShown) out += fmt::format("<p>And {} stretches more.</p>\n", c.stretches.size() - kShown);
  return out;
}

std::string tracking_section(const Context& c) {
  const std::vector<FrameRow>& rows = c.log.rows();
  std::string out = heading("tracking", "Tracking, filter and keyframes") + "<div class=\"grid\">\n";
  // What is extracted is mostly features.count, frame by frame: what became of it tells more.
  const auto by_images = [&](const FrameRow& r, double value) { return r.by_images() ? value : std::nan(""); };
  const TimeChart points{
      "Map points and features",
      "a frame",
      {line_of(c, "est", "of the pose", [&](size_t i) { return by_images(rows[i], rows[i].inliers); }),
       line_of(c, "second", "matched, not fitting", [&](size_t i) { return by_images(rows[i], rows[i].misfits); }),
       line_of(c, "removed", "on movers", [&](size_t i) { return rows[i].removed; })},
      true,
      {{static_cast<double>(c.facts.limits.min_inliers), "fewest for a pose"}}};
  out += figure(time_chart(points, c.duration, c.bands));
  const TimeChart removed{"What the filter removed",
                          "share [%]",
                          {line_of(c, "second", "of the features",
                                   [&](size_t i) { return 100.0 * rows[i].removed / std::max(1, rows[i].features); }),
                           line_of(c, "est", "of the picture", [&](size_t i) { return 100.0 * rows[i].masked; })},
                          true,
                          {},
                          5};
  out += figure(time_chart(removed, c.duration, c.bands));
  std::vector<KeyframeTicks> ticks;
  for (size_t rule = 0; rule < c.log.rules().size(); ++rule) {
    ticks.push_back({c.log.rules()[rule].empty() ? "keyframes" : c.log.rules()[rule], {}});
    for (size_t i = 0; i < rows.size(); ++i)
      if (rows[i].keyframe && rows[i].rule == rule) ticks.back().seconds.push_back(c.seconds[i]);
  }
  out += figure(keyframe_chart(ticks, c.duration, c.bands));
  const TimeChart image{"The images",
                        "share [%]",
                        {line_of(c, "est", "with depth", [&](size_t i) { return 100.0 * rows[i].depth; }),
                         line_of(c, "second", "brightness", [&](size_t i) { return rows[i].brightness / 2.55; })},
                        true};
  out += figure(time_chart(image, c.duration, c.bands));
  return out + "</div>\n";
}

std::string stages_section(const Context& c) {
  const std::vector<FrameRow>& rows = c.log.rows();
  const Statistics& s = c.facts.statistics;
  const double frame_ms = 1000 / c.fps;
  TimeChart chart{"Each frame's time",
                  "[ms]",
                  {line_of(c, "est", "tracking", [&](size_t i) { return rows[i].tracking_ms; }),
                   line_of(c, "second", "waiting", [&](size_t i) { return rows[i].waiting_ms; })},
                  true,
                  {{frame_ms, fmt::format("{:.1f} ms a frame", frame_ms)}}};
  std::string out = "<!--clock-->" + heading("stages", "Times");
  const auto over =
      std::count_if(rows.begin(), rows.end(), [&](const FrameRow& r) { return r.tracking_ms > frame_ms; });
  out += fmt::format(
      "<p>At {:g} frames a second a frame has {:.1f} ms. Tracking took longer {} of {} times. Other stages run beside "
      "it, "
      "or are parts of it.</p>\n<div class=\"grid\">\n",
      c.fps, frame_ms, over, rows.size());
  out += "<div>" + figure(time_chart(chart, c.duration, c.bands));
  std::vector<std::pair<std::string, StageSummary>> order(s.stages.begin(), s.stages.end());
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    const auto total = [](const StageSummary& t) { return t.mean_ms * static_cast<double>(t.count); };
    return std::pair(a.first == "tracking", total(a.second)) > std::pair(b.first == "tracking", total(b.second));
  });
  out +=
      "<div class=\"wide\"><table>\n<tr><th>stage, times in ms</th><th class=\"n\">mean</th><th class=\"n\">median</th>"
      "<th class=\"n\">p95</th><th class=\"n\">largest</th><th class=\"n\">times</th></tr>\n";
  std::vector<StageRow> stages;
  for (const auto& [name, t] : order) {
    out += fmt::format(
        "<tr><td>{}</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}</td><td "
        "class=\"n\">{:.1f}</td><td class=\"n\">{}</td></tr>\n",
        svg::escaped(spaced(name)), t.mean_ms, t.median_ms, t.p95_ms, t.max_ms, t.count);
    const auto counts = s.stage_histograms.find(name);
    stages.push_back({spaced(name), counts == s.stage_histograms.end() ? std::vector<int>() : counts->second});
  }
  out += "</table></div></div>\n" + figure(stage_chart(stages, frame_ms));
  return out + "</div><!--/clock-->\n";
}

std::string pictures_section(const Context& c) {
  constexpr size_t kEach = 3;
  const bool truth = c.truth.evaluation.has_value();
  const std::vector<FrameRow>& rows = c.log.rows();
  // Higher is worse. Frames without a pose are shown with their stretches.
  const auto badness = [&](const OverlayPicture* p) {
    return truth ? c.error_m[p->row] : -static_cast<double>(rows[p->row].inliers);
  };
  std::vector<const OverlayPicture*> ranked;
  for (const OverlayPicture* p : c.log.pictures())
    if (rows[p->row].by_images() && std::isfinite(badness(p))) ranked.push_back(p);
  if (ranked.empty()) return "";
  const size_t kept = ranked.size();
  std::stable_sort(ranked.begin(), ranked.end(), [&](auto* a, auto* b) { return badness(a) > badness(b); });
  std::array<std::vector<const OverlayPicture*>, 3> chosen;
  for (size_t group : {0, 1, 2})
    for (size_t n = 0; n < std::min(kEach, (kept + 2) / 3) && !ranked.empty(); ++n) {
      uint64_t mixed = (c.facts.seed + n + 1) * 0x9E3779B97F4A7C15ULL;
      mixed ^= mixed >> 29;
      const size_t at = group == 0 ? 0 : group == 1 ? ranked.size() - 1 : mixed % ranked.size();
      chosen[group].push_back(ranked[at]);
      ranked.erase(ranked.begin() + static_cast<std::ptrdiff_t>(at));
    }
  std::string out = heading("pictures", "Pictures") +
                    fmt::format("<p>Worst and best by {}, and some at random, of {} that were kept.</p>\n",
                                truth ? "their error" : "the number of map points that the pose rests on", kept);
  out += "<div class=\"key overlay-key\">";
  for (const auto& [state, shape, name] :
       {std::tuple{"used", "M11 8h.1", "used"}, std::tuple{"unused", "M11 8h.1", "matched with nothing"},
        std::tuple{"outlier", "M8 5l6 6m0-6l-6 6", "does not fit its map point"},
        std::tuple{"dynamic", "M7 11h8l-4-7z", "removed: may move"}})
    out += fmt::format(
        "<span><svg class=\"overlay\" viewBox=\"0 0 22 16\" aria-hidden=\"true\"><path class=\"{}\" "
        "d=\"{}\"/></svg>{}</span>",
        state, shape, name);
  out +=
      "<span><svg class=\"overlay\" viewBox=\"0 0 22 16\" aria-hidden=\"true\"><path class=\"mask\" d=\"M3 "
      "3h16v10h-16z\"/></svg>mover</span></div>\n";
  out += "<div class=\"grid three pictures\">\n";
  for (size_t group : {0, 1, 2})
    for (const OverlayPicture* p : chosen[group]) {
      const char* name = group == 0 ? "Worst" : group == 1 ? "Best" : "Random";
      const std::string at = when(c, p->row);
      out += fmt::format(
          "<figure>{}<figcaption><b>{}</b>: {}{} · {} map points · {} features removed</figcaption></figure>\n",
          overlay_svg(*p, fmt::format("{}: {}", name, at)), name, at,
          truth ? " · error " + metres(c.error_m[p->row]) : "", rows[p->row].inliers, rows[p->row].removed);
    }
  return out + "</div>\n";
}

std::string events_section(const Context& c) {
  std::string table;
  for (const Happening& h : c.log.happenings())
    table += fmt::format("<tr><td class=\"n\">{}</td><td class=\"n\">{:.2f}</td><td>{}</td><td>{}</td></tr>\n", h.row,
                         c.seconds[h.row], spaced(name_of(h.kind)), svg::escaped(h.text));
  if (table.empty()) return "";
  return heading("events", "Events") +
         "<div class=\"wide\"><table>\n<tr><th class=\"n\">frame</th><th "
         "class=\"n\">s</th><th>what</th><th></th></tr>\n" +
         table + "</table></div>\n";
}

std::string settings_section(const Context& c) {
  std::string out = heading("settings", "How it was run") + "<div class=\"wide\"><table>\n";
  for (const auto& [name, value] : c.facts.choices)
    out += "<tr><th>" + svg::escaped(name) + "</th><td>" + svg::escaped(value) + "</td></tr>\n";
  out += "</table></div>\n";
  if (c.facts.settings.empty()) return out + "<p>All settings are the default ones.</p>\n</main>\n";
  out += "<div class=\"wide\"><table>\n<tr><th>setting that differs</th><th>here</th><th>default</th></tr>\n";
  for (const Setting& s : c.facts.settings)
    out += "<tr><td>" + svg::escaped(s.key) + "</td><td>" + svg::escaped(s.value) + "</td><td>" +
           svg::escaped(s.initial) + "</td></tr>\n";
  return out + "</table></div>\n</main>\n";
}

}  // namespace dkb::report
