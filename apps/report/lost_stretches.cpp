// SPDX-License-Identifier: Apache-2.0
#include "report/lost_stretches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dkb/util/quantile.h"

namespace dkb::report {
namespace {

constexpr size_t kFewest = 3;        // frames of a part, but for the first: causes flicker at their limits
constexpr double kDark = 12;         // [grey levels]
constexpr double kCovered = 0.5;     // share of the image on movers, or of the features removed
constexpr double kNoDepth = 0.25;    // share of the image, or of the features, with depth
constexpr double kFastShare = 0.08;  // of the image's width that it moves from frame to frame
constexpr double kGap = 4;           // usual intervals between frames

// What a set of frames is like, by medians.
struct Likeness {
  double features = 0, removed = 0, inliers = 0;  // a frame
  double masked = 0, with_depth = 0, depth = 0, brightness = 0;

  double removed_share() const { return features > 0 ? removed / features : 0; }
};

Likeness likeness_of(const std::vector<const FrameRow*>& rows) {
  Likeness l;
  if (rows.empty()) return l;
  const auto median = [&](auto field) {
    std::vector<double> values;
    for (const FrameRow* r : rows) values.push_back(static_cast<double>(r->*field));
    return upper_median(values);
  };
  return {median(&FrameRow::features),  median(&FrameRow::removed),    median(&FrameRow::inliers),
          median(&FrameRow::masked),    median(&FrameRow::with_depth), median(&FrameRow::depth),
          median(&FrameRow::brightness)};
}

double interval_s(const std::vector<FrameRow>& rows, size_t row) {
  return 1e-9 * static_cast<double>(rows[row].stamp_ns - rows[row - 1].stamp_ns);
}

std::string percent(double share) {
  return fmt::format("{:.0f} %", 100 * share);
}

class Judge {
 public:
  Judge(const std::vector<FrameRow>& rows, const CauseLimits& limits) : rows_(rows), limits_(limits) {
    std::vector<const FrameRow*> tracked;
    std::vector<double> intervals;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].by_images()) tracked.push_back(&rows[i]);
      if (i > 0) intervals.push_back(interval_s(rows, i));
    }
    usual_ = likeness_of(tracked);
    any_tracked_ = !tracked.empty();
    if (!intervals.empty()) usual_interval_ = upper_median(intervals);
  }

  // The stretch's frames by their cause.
  void judge(LostStretch& stretch) const {
    std::vector<LostPart>& parts = stretch.parts;
    Look last = Look::fair;
    for (size_t i = stretch.begin; i < stretch.end; ++i) {
      const Look look = look_of(likeness_of({&rows_[i]}), stretch.state);
      if (parts.empty() || look != last) parts.push_back({i, i, "", ""});
      parts.back().end = i + 1;
      last = look;
    }
    for (size_t k = 1; k < parts.size();) {
      const bool brief = parts[k].end - parts[k].begin < kFewest;
      if (!brief &&
          look_of(part_likeness(parts[k]), stretch.state) != look_of(part_likeness(parts[k - 1]), stretch.state)) {
        ++k;
        continue;
      }
      parts[k - 1].end = parts[k].end;
      parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(k));
    }
    for (LostPart& part : parts) explain(stretch, part);
  }

 private:
  // What the pictures of a part are like, for tracking.
  enum class Look { covered, bare, without_depth, fair };
  Look look_of(const Likeness& now, TrackingState state) const {
    const double wanted = state == TrackingState::initialising ? limits_.initial_points : 5 * limits_.min_inliers;
    if (!dark(now) && (now.masked > kCovered || now.removed_share() > kCovered)) return Look::covered;
    if (now.features < wanted || (any_tracked_ && now.features < 0.25 * usual_.features)) return Look::bare;
    const bool begins = now.with_depth >= limits_.initial_points;
    if (now.depth < kNoDepth || now.with_depth < kNoDepth * (now.features - now.removed) ||
        (state == TrackingState::initialising && !begins))
      return Look::without_depth;
    return Look::fair;
  }
  static bool dark(const Likeness& now) { return now.brightness < kDark; }

  Likeness part_likeness(const LostPart& part) const {
    std::vector<const FrameRow*> rows;
    for (size_t i = part.begin; i < part.end; ++i) rows.push_back(&rows_[i]);
    return likeness_of(rows);
  }

  void explain(const LostStretch& stretch, LostPart& part) const {
    const Likeness now = part_likeness(part);
    const bool first = part.begin == stretch.begin;
    const double gap = part.begin > 0 ? interval_s(rows_, part.begin) : 0;
    const Look look = look_of(now, stretch.state);
    if (look == Look::covered)
      return say(part, "covered by people",
                 fmt::format("movers cover {} of the picture, and {:.0f} of {:.0f} features lie on them",
                             percent(now.masked), now.removed, now.features));
    if (look == Look::bare)
      return say(part, "no features",
                 fmt::format("{:.0f} features a frame, usually {:.0f}", now.features, usual_.features) +
                     (dark(now) ? fmt::format("; the picture is dark: grey level {:.0f} of 255", now.brightness) : ""));
    if (look == Look::without_depth)
      return say(
          part, "no depth",
          fmt::format("{} of the picture and {:.0f} of {:.0f} features have depth, usually {} and {:.0f}",
                      percent(now.depth), now.with_depth, now.features, percent(usual_.depth), usual_.with_depth) +
              no_new_map(part, stretch.state));
    if (first && usual_interval_ > 0 && gap > kGap * usual_interval_)
      return say(part, "frames missing",
                 fmt::format("{:.2f} s without a frame before it, usually {:.3f} s", gap, usual_interval_));
    if (const auto [turn, pixels] = speed_before(part.begin); first && pixels > kFastShare * limits_.image_width)
      return say(
          part, "too fast",
          fmt::format("the camera turned by {:.0f} deg/s before it: {:.0f} px from frame to frame", turn, pixels));
    const size_t frames = part.end - part.begin;
    const auto alike = std::count_if(rows_.begin() + static_cast<std::ptrdiff_t>(part.begin),
                                     rows_.begin() + static_cast<std::ptrdiff_t>(part.end),
                                     [](const FrameRow& r) { return r.ambiguous; });
    if (2 * static_cast<size_t>(alike) > frames)
      return say(part, "a look-alike",
                 fmt::format("{} of its {} frames show a place of the map or one that looks like it", alike, frames));
    say(part, "not recognised",
        fmt::format("{:.0f} features a frame, {:.0f} of them with depth, but ", now.features, now.with_depth) +
            (now.inliers > 0 ? fmt::format("only {:.0f} fit the map (at least {})", now.inliers, limits_.min_inliers)
                             : "nothing of the map is found") +
            no_new_map(part, stretch.state));
  }

  // Why tracking does not go on in a map of its own, if that is for want of depth: frames in a row must have it.
  std::string no_new_map(const LostPart& part, TrackingState state) const {
    size_t few = 0;
    for (size_t i = part.begin; i < part.end; ++i) few += rows_[i].with_depth < limits_.initial_points;
    if (state == TrackingState::predicted || few == 0) return "";
    const size_t frames = part.end - part.begin;
    return fmt::format("; {} too few with depth to begin a {}map (at least {})",
                       few < frames ? fmt::format("{} of {} frames have", few, frames) : std::string("that is"),
                       state == TrackingState::lost ? "new " : "", limits_.initial_points);
  }

  static void say(LostPart& part, const char* cause, std::string evidence) {
    part.cause = cause;
    part.evidence = std::move(evidence);
  }

  // [deg/s] and [px per frame], the fastest of the last three frames with a pose.
  std::pair<double, double> speed_before(size_t row) const {
    std::pair<double, double> fastest{0, 0};
    for (size_t i = row; i-- > 1 && row - i <= 3;) {
      const double dt = interval_s(rows_, i);
      if (!(dt > 0)) continue;
      const double turned = rows_[i].turned_deg;
      fastest = std::max(fastest, {turned / dt, limits_.focal * std::tan(std::min(turned, 80.0) * 3.14159265 / 180)});
    }
    return fastest;
  }

  const std::vector<FrameRow>& rows_;
  CauseLimits limits_;
  Likeness usual_;
  bool any_tracked_ = false;
  double usual_interval_ = 0;
};

}  // namespace

std::vector<LostStretch> lost_stretches(const std::vector<FrameRow>& rows, const CauseLimits& limits) {
  const Judge judge(rows, limits);
  std::vector<LostStretch> stretches;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].by_images()) continue;
    if (stretches.empty() || stretches.back().end != i || stretches.back().state != rows[i].state)
      stretches.push_back({i, i, rows[i].state, {}});
    stretches.back().end = i + 1;
  }
  for (LostStretch& stretch : stretches) judge.judge(stretch);
  return stretches;
}

}  // namespace dkb::report
