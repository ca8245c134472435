// SPDX-License-Identifier: Apache-2.0
#include "report/lost_stretches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dkb/util/quantile.h"

namespace dkb::report {
namespace {

constexpr size_t kFirst = 5;         // frames by which a stretch is judged
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

  void judge(LostStretch& stretch) const {
    std::vector<const FrameRow*> first;
    for (size_t i = stretch.begin; i < std::min(stretch.end, stretch.begin + kFirst); ++i) first.push_back(&rows_[i]);
    const Likeness now = likeness_of(first);
    const double wanted =
        stretch.state == TrackingState::initialising ? limits_.initial_points : 5 * limits_.min_inliers;
    const double gap = stretch.begin > 0 ? interval_s(rows_, stretch.begin) : 0;
    const bool dark = now.brightness < kDark;
    if (!dark && (now.masked > kCovered || now.removed_share() > kCovered))
      say(stretch, "covered by people",
          fmt::format("movers cover {} of the picture, and {:.0f} of {:.0f} features lie on them", percent(now.masked),
                      now.removed, now.features));
    else if (now.features < wanted || (any_tracked_ && now.features < 0.25 * usual_.features))
      say(stretch, "no features",
          fmt::format("{:.0f} features a frame, usually {:.0f}", now.features, usual_.features) +
              (dark ? fmt::format("; the picture is dark: grey level {:.0f} of 255", now.brightness) : ""));
    else if (now.depth < kNoDepth || now.with_depth < kNoDepth)
      say(stretch, "no depth",
          fmt::format("{} of the picture and {} of the features have depth, usually {} and {}", percent(now.depth),
                      percent(now.with_depth), percent(usual_.depth), percent(usual_.with_depth)));
    else if (usual_interval_ > 0 && gap > kGap * usual_interval_)
      say(stretch, "frames missing",
          fmt::format("{:.2f} s without a frame before it, usually {:.3f} s", gap, usual_interval_));
    else if (const auto [turn, pixels] = speed_before(stretch.begin); pixels > kFastShare * limits_.image_width)
      say(stretch, "too fast",
          fmt::format("the camera turned by {:.0f} deg/s before it: {:.0f} px from frame to frame", turn, pixels));
    else if (const auto alike =
                 std::count_if(first.begin(), first.end(), [](const FrameRow* r) { return r->ambiguous; });
             2 * alike > static_cast<long>(first.size()))
      say(stretch, "a look-alike",
          fmt::format("{} of its first {} frames show a place of the map or one that looks like it", alike,
                      first.size()));
    else
      say(stretch, "not recognised",
          fmt::format("{:.0f} features a frame, {} with depth, but only {:.0f} fit the map (at least {})", now.features,
                      percent(now.with_depth), now.inliers, limits_.min_inliers));
  }

 private:
  static void say(LostStretch& stretch, const char* cause, std::string evidence) {
    stretch.cause = cause;
    stretch.evidence = std::move(evidence);
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
      stretches.push_back({i, i, rows[i].state, "", ""});
    stretches.back().end = i + 1;
  }
  for (LostStretch& stretch : stretches) judge.judge(stretch);
  return stretches;
}

}  // namespace dkb::report
