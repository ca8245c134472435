// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/adaptive_policy.h"

#include <fmt/format.h>

#include <algorithm>

#include "dkb/util/quantile.h"

namespace dkb {
namespace {

constexpr int kFewTracked = 50;  // [points] fewer tracked ones call for a keyframe
// [keyframes] whose points may be a point's neighbours: those that share most. In a place long seen hundreds share
// some.
constexpr size_t kKeyframesAround = 30;

// Median depth [m] of the features that show a map point; 0 when none has a depth.
double median_depth(const KeyframeContext& q) {
  std::vector<float> depths;
  for (size_t f = 0; f < q.points->size(); ++f)
    if ((*q.points)[f] != kNoPoint && q.features->keypoints[f].depth > 0)
      depths.push_back(q.features->keypoints[f].depth);
  return depths.empty() ? 0 : upper_median(depths);
}

}  // namespace

AdaptiveKeyframeOptions paper_keyframe_options() {
  AdaptiveKeyframeOptions options;
  options.translation_unit = TranslationUnit::centimetre;
  options.similarity = Similarity::printed;
  options.normals = NormalSum::plain;
  options.visibility_levels = 4;
  options.floor_reference_ratio = 0.25;
  options.floor_kept_ratio = 0;
  return options;
}

AdaptiveKeyframePolicy::AdaptiveKeyframePolicy(const AdaptiveKeyframeOptions& options, int image_width,
                                               int image_height)
    : options_(options), image_width_(image_width), image_height_(image_height) {}

const AdaptiveKeyframePolicy::KeyframePoint* AdaptiveKeyframePolicy::find(PointId id) const {
  const auto at = std::lower_bound(keyframe_points_.begin(), keyframe_points_.end(), id,
                                   [](const KeyframePoint& p, PointId wanted) { return p.id < wanted; });
  return at != keyframe_points_.end() && at->id == id ? &*at : nullptr;
}

bool AdaptiveKeyframePolicy::level_changed(const KeyframePoint& p, const Eigen::Vector3d& camera_in_keyframe) const {
  if (p.level == 0) return false;
  return visibility_level(view_angle_deg(p.normal_in_keyframe, camera_in_keyframe - p.point_in_keyframe),
                          options_.visibility_levels) != p.level;
}

bool AdaptiveKeyframePolicy::stale(const Map& map) const {
  return std::any_of(keyframe_points_.begin(), keyframe_points_.end(), [&map](const KeyframePoint& p) {
    return map.point(p.id) == nullptr && map.resolve(p.id) != kNoPoint;
  });
}

// Normals and levels of the keyframe's points and the reference frame's counts: when first asked for, and when points
// were fused since.
void AdaptiveKeyframePolicy::study_keyframe(KeyframeId id, const Map& map) {
  std::vector<KeyframeId> around = {id};
  for (const Covisible& c : map.keyframe(id)->covisible)
    if (around.size() <= kKeyframesAround) around.push_back(c.keyframe);
  const std::vector<PointId> points = map.points_of({id}), cloud = map.points_of(around);
  const auto normals = surface_normals(map, points, cloud, options_.normals);

  const Rigid3 keyframe_from_world = map.cam_from_world(id);
  keyframe_points_.clear();
  for (size_t i = 0; i < points.size(); ++i) {
    KeyframePoint p;
    p.id = points[i];
    p.point_in_keyframe = keyframe_from_world * map.point(points[i])->position;
    if (normals[i]) {
      p.normal_in_keyframe = keyframe_from_world.rotation * *normals[i];
      p.level =
          visibility_level(view_angle_deg(p.normal_in_keyframe, -p.point_in_keyframe), options_.visibility_levels);
    }
    keyframe_points_.push_back(p);
  }
  studied_ = id;

  const Eigen::Vector3d camera = centre_in_world(reference_.cam_from_keyframe);
  reference_matches_ = reference_changed_ = 0;
  for (PointId named : reference_.points)
    if (const KeyframePoint* p = find(map.resolve(named))) {
      ++reference_matches_;
      reference_changed_ += level_changed(*p, camera);
    }
}

AdaptiveKeyframePolicy::Matches AdaptiveKeyframePolicy::match(const KeyframeContext& q,
                                                              const Rigid3& cam_from_keyframe) const {
  Matches result;
  const Eigen::Vector3d camera = centre_in_world(cam_from_keyframe);
  for (size_t f = 0; f < q.points->size(); ++f) {
    const KeyframePoint* p = (*q.points)[f] == kNoPoint ? nullptr : find((*q.points)[f]);
    if (p == nullptr) continue;
    ++result.matches;
    result.changed += level_changed(*p, camera);
    result.pixels.push_back(q.features->keypoints[f].image_pixel);
  }
  return result;
}

KeyframeDecision AdaptiveKeyframePolicy::decide(const KeyframeContext& q, const Map& map) {
  const Rigid3 cam_from_keyframe = q.cam_from_world * q.last_keyframe_cam_from_world.inverse();
  if (q.last_keyframe != reference_.keyframe) {
    reference_ = {q.last_keyframe, {}, cam_from_keyframe, q.tracked_points};
    studied_ = kNoKeyframe;
    for (PointId id : *q.points)
      if (id != kNoPoint) reference_.points.push_back(id);
  }

  KeyframeDecision decision;
  KeyframeTests& tests = decision.tests;
  tests.waited = q.frame - q.last_keyframe_frame >= options_.min_frames_between;
  const Parallax parallax = parallax_between(q.last_keyframe_cam_from_world, q.cam_from_world,
                                             units_per_metre(options_.translation_unit, median_depth(q)));
  tests.parallax = gate_.passes(parallax);

  MatchCounts counts;
  VisibilityVote visibility;
  SpreadVote spread;
  tests.votes_asked = tests.parallax && tests.waited && map.keyframe(q.last_keyframe) != nullptr;
  if (tests.votes_asked) {
    if (studied_ != q.last_keyframe || stale(map)) study_keyframe(q.last_keyframe, map);
    const Matches matches = match(q, cam_from_keyframe);
    counts = {matches.matches,    matches.changed,    q.tracked_points,
              reference_matches_, reference_changed_, reference_.tracked_points};
    visibility = vote_by_visibility(counts, options_.similarity);
    spread = vote_by_spread(spread_grid(matches.pixels, image_width_, image_height_));
    tests.visibility = visibility.votes;
    tests.spread = spread.votes;
  }
  tests.few_points = q.tracked_points < kFewTracked;
  tests.close_points = q.tracked_close_points < kFewClose && q.creatable_close_points >= kManyCreatable;
  tests.view_left = q.tracked_points < options_.floor_reference_ratio * q.reference_points ||
                    q.tracked_points < options_.floor_kept_ratio * reference_.tracked_points;

  if (tests.visibility && tests.spread)
    decision.rule = KeyframeRule::adaptive;
  else if (tests.waited && (tests.few_points || tests.close_points || tests.view_left))
    decision.rule = KeyframeRule::floor;
  decision.insert = decision.rule != KeyframeRule::none;
  if (!q.explain) return decision;
  decision.explanation = fmt::format(
      "{} frames since the last keyframe (at least {}: {}); parallax {:.2f} deg + {:.2f} against T {:.2f} (F {:.3f}): "
      "{}; ",
      q.frame - q.last_keyframe_frame, options_.min_frames_between, yes_or_no(tests.waited), parallax.rotation_deg,
      parallax.translation, gate_.threshold(), gate_.factor(), yes_or_no(tests.parallax));
  if (!tests.votes_asked)
    decision.explanation +=
        tests.parallax && tests.waited ? "no votes before the last keyframe is in the map; " : "votes not asked; ";
  else if (!visibility.defined)
    decision.explanation += "no votes without matches; ";
  else
    decision.explanation += fmt::format(
        "changed {} of {} matches (reference {} of {}, points {} / {}), S {:.2f}, theta {:.3f}, alpha {:.3f}, beta "
        "{:.3f}, against {:.2f}: {}; ECOG {:.3f} against {:.3f}: {}; ",
        counts.changed, counts.matches, counts.reference_changed, counts.reference_matches, counts.points,
        counts.reference_points, visibility.s, visibility.theta, visibility.alpha, visibility.beta,
        visibility.threshold, yes_or_no(tests.visibility), spread.ecog, spread.threshold, yes_or_no(tests.spread));
  decision.explanation += fmt::format(
      "tracked {} (at least {}: {}), at least {} of the reference's {} and {} of {} after the last keyframe: {}; close "
      "{} (+{}), not below {} with +{}: {}",
      q.tracked_points, kFewTracked, yes_or_no(!tests.few_points), options_.floor_reference_ratio, q.reference_points,
      options_.floor_kept_ratio, reference_.tracked_points, yes_or_no(!tests.view_left), q.tracked_close_points,
      q.creatable_close_points, kFewClose, kManyCreatable, yes_or_no(!tests.close_points));
  return decision;
}

}  // namespace dkb
