// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/options.h"

#include <algorithm>
#include <sstream>

#include "dkb/util/errors.h"
#include "dkb_slam/options.h"

namespace dkb {

void PipelineOptions::check() const {
  require_option(mapper_latency > 0, "pipeline.mapper_latency", mapper_latency, "greater than 0 s");
  require_option(mapper_queue >= 1, "pipeline.mapper_queue", mapper_queue, "at least 1");
}

void SlamOptions::check() const {
  features.check();
  depth.check();
  noise.check();
  tracking.check();
  baseline_keyframes.check();
  adaptive_keyframes.check();
  mapping.check();
  loop_closing.check();
  readout.check();
  dynamics.check();
  evidence.check();
  movers.check();
  dense.check();
  pipeline.check();
}

SlamOptions preset(const std::string& name) {
  const std::vector<std::string> names = {"default", "paper", "orb"};
  SlamOptions o;
  if (name == "default") return o;
  if (name != "paper" && name != "orb")
    throw InputError("--preset: there is no preset \"" + name + "\"" + did_you_mean(name, names) +
                     "; presets: default, paper, orb");
  // What the paper does not have: the camera's own motion within an image and between images.
  o.depth.model_rolling_shutter = false;
  o.depth.model_time_offset = false;
  o.dynamics.filter = FilterKind::paper;
  o.keyframe_policy = KeyframePolicyKind::adaptive;
  o.adaptive_keyframes = paper_keyframe_options();
  o.mapping.ba.weights.adaptive = false;
  if (name == "orb") disable_parts(o, {.dynamic_removal = true, .keyframes = true, .weighted_ba = true});
  return o;
}

void disable_parts(SlamOptions& options, const DisabledParts& parts) {
  if (parts.dynamic_removal) options.dynamics.filter = FilterKind::none;
  if (parts.keyframes) options.keyframe_policy = KeyframePolicyKind::baseline;
  if (parts.weighted_ba) options.mapping.ba.weighted = false;
  if (parts.loop) options.loop_closing.loop.enabled = false;
}

void bind_settings(Settings& s, SlamOptions& o) {
  s.bind("seed", &o.seed, "reaches every source of randomness");

  s.bind("features.count", &o.features.count, "[features] wanted per image");
  s.bind("features.levels", &o.features.levels, "pyramid levels");
  s.bind("features.scale", &o.features.scale, "size of a pyramid level over the next smaller one");
  s.bind("features.fast_threshold", &o.features.fast_threshold, "[grey levels] corner threshold");
  s.bind("features.fast_threshold_min", &o.features.fast_threshold_min,
         "[grey levels] threshold of cells without corners");
  s.bind("features.subpixel", &o.features.subpixel, "refine corners below the pixel");

  s.bind("depth.edge_fraction", &o.depth.edge_fraction, "[1] depth step in a 3 x 3 window that voids a depth");
  s.bind("depth.model_time_offset", &o.depth.model_time_offset, "carry depths to the colour image's time");

  s.bind("depth.model_rolling_shutter", &o.depth.model_rolling_shutter,
         "undo the rolling shutter (needs the camera's readout)");

  s.bind("noise.pixel_sigma", &o.noise.pixel_sigma, "[px] of a corner on the finest level");
  s.bind("noise.scale_exponent", &o.noise.scale_exponent, "growth of that with the level's scale");
  s.bind("noise.depth_sigma_base", &o.noise.depth_sigma_base, "[m] depth noise at 0.4 m");
  s.bind("noise.depth_sigma_quadratic", &o.noise.depth_sigma_quadratic, "[1/m] growth with (z - 0.4 m)^2");
  s.bind("noise.depth_sigma_factor", &o.noise.depth_sigma_factor,
         "factor on both for edges, registration, calibration");

  TrackingOptions& t = o.tracking;
  s.bind("tracking.initial_points", &t.initial_points, "features with depth that the first frame needs");
  s.bind("tracking.min_matches", &t.min_matches, "matches with the last frame that make a pose worth trying");
  s.bind("tracking.min_inliers", &t.min_inliers, "inliers of a pose; fewer: lost");
  s.bind("tracking.close_depth", &t.close_depth, "[m] depths below make map points at once");
  s.bind("tracking.min_new_points", &t.min_new_points, "nearest depths that make points whatever close_depth says");
  s.bind("tracking.radius_last_frame", &t.radius_last_frame, "[px] search around the predicted position");
  s.bind("tracking.radius_wide", &t.radius_wide, "[px] second try");
  s.bind("tracking.radius_local_map", &t.radius_local_map, "[px] search for local map points");
  s.bind("tracking.odometry_sigma_factor", &t.odometry_sigma_factor,
         "on the noise of visual-odometry points; 0 = without them");
  s.bind("tracking.match_distance", &t.match_distance, "[bits] of a match with a map point");
  s.bind("tracking.match_ratio", &t.match_ratio, "best over second best distance of such a match");
  s.bind("tracking.established_after", &t.established_after,
         "[s] since its birth before a point may be found where a mover is");
  s.bind("tracking.refresh_after", &t.refresh_after, "[s] between choices of local map points, at most");
  s.bind("tracking.new_map_after", &t.new_map_after, "[s] lost in a row until a new map is started; 0 = never");
  RelocalisationOptions& r = t.relocalisation;
  s.bind("tracking.relocalisation.candidates", &r.candidates, "look-alike keyframes that a lost tracker tries");
  s.bind("tracking.relocalisation.neighbours", &r.neighbours, "covisible keyframes matched along with each");
  s.bind("tracking.relocalisation.min_matches", &r.min_matches, "by descriptor alone that make one worth a try");
  s.bind("tracking.relocalisation.min_ransac_inliers", &r.min_ransac_inliers, "of these, that must agree on a pose");
  s.bind("tracking.relocalisation.radius", &r.radius, "[px] first search around that pose");
  s.bind("tracking.relocalisation.radius_fine", &r.radius_fine, "[px] second search");
  s.bind("tracking.relocalisation.min_inliers", &r.min_inliers, "points that the final pose rests on");
  s.bind("tracking.relocalisation.min_share", &r.min_share, "of well-known points in view that must be found");
  s.bind("tracking.relocalisation.min_similarity", &r.min_similarity, "share of these that must look as they did");
  s.bind("tracking.relocalisation.min_similarity_far", &r.min_similarity_far,
         "the same where the camera cannot have come to");
  s.bind("tracking.relocalisation.max_distance", &r.max_distance, "[m] from where it was lost to there ...");
  s.bind("tracking.relocalisation.max_speed", &r.max_speed, "[m/s] ... and its growth with time");
  s.bind("tracking.relocalisation.max_position_sd", &r.max_position_sd, "[m] standard deviation of the camera's place");
  s.bind("tracking.relocalisation.ambiguity", &r.ambiguity,
         "share of the most inliers that makes a pose elsewhere a rival ...");
  s.bind("tracking.relocalisation.clear_lead", &r.clear_lead, "... unless it looks less alike by this share");
  s.bind("tracking.local_map.voted_keyframes", &t.local_map.voted_keyframes,
         "keyframes that share most points with the frame");
  s.bind("tracking.local_map.neighbours_of_each", &t.local_map.neighbours_of_each,
         "covisible keyframes added for each");
  s.bind("tracking.local_map.keyframes", &t.local_map.keyframes, "keyframes of the local map, at most");

  s.bind("keyframes.policy", &o.keyframe_policy,
         {{"adaptive", KeyframePolicyKind::adaptive}, {"baseline", KeyframePolicyKind::baseline}},
         "who decides that a frame becomes a keyframe");
  AdaptiveKeyframeOptions& a = o.adaptive_keyframes;
  s.bind("keyframes.window", &a.parallax.window, "[frames] parallaxes averaged (DKB eqs. 17, 18)");
  s.bind("keyframes.threshold_min", &a.parallax.threshold_min,
         "parallax that opens the gate in fast motion (DKB eq. 25)");
  s.bind("keyframes.threshold_max", &a.parallax.threshold_max, "the same at rest");
  s.bind("keyframes.rotation_max", &a.parallax.rotation_max, "[deg] Theta_max (DKB eq. 24)");
  s.bind("keyframes.translation_max", &a.parallax.translation_max, "[unit] t_max (DKB eq. 24)");
  s.bind("keyframes.translation_unit", &a.parallax.translation_unit,
         {{"metre", TranslationUnit::metre},
          {"centimetre", TranslationUnit::centimetre},
          {"depth_percent", TranslationUnit::depth_percent}},
         "of translations in the gate");
  s.bind("keyframes.similarity", &a.similarity, {{"printed", Similarity::printed}, {"pks", Similarity::pks}},
         "S as the paper prints it or as its source has it (DKB eq. 34)");
  s.bind("keyframes.normals", &a.normals, {{"oriented", NormalSum::oriented}, {"plain", NormalSum::plain}},
         "cross products turned toward the camera or summed as printed (DKB eq. 28)");
  s.bind("keyframes.visibility_levels", &a.visibility_levels, "of 10 degrees each; the paper has 4 (DKB eq. 32)");
  s.bind("keyframes.min_frames_between", &a.min_frames_between, "[frames] from a keyframe to the next");
  s.bind("keyframes.floor_min_tracked", &a.floor_min_tracked, "[points] fewer make a keyframe whatever the votes");
  s.bind("keyframes.floor_few_close", &a.floor_few_close, "[points] fewer tracked close points ...");
  s.bind("keyframes.floor_many_creatable", &a.floor_many_creatable, "[points] ... with so many to be made do so too");
  s.bind("keyframes.floor_reference_ratio", &a.floor_reference_ratio,
         "likewise a smaller share of the reference's points");
  s.bind("keyframes.floor_kept_ratio", &a.floor_kept_ratio, "or of the points tracked right after the last keyframe");

  BaselineKeyframeOptions& b = o.baseline_keyframes;
  s.bind("keyframes.baseline.frames_between", &b.frames_between, "[frames] longest wait while mapping is busy");
  s.bind("keyframes.baseline.min_tracked", &b.min_tracked, "[points] fewer make no keyframe");
  s.bind("keyframes.baseline.reference_ratio", &b.reference_ratio,
         "share of the reference's points below which a keyframe is due");
  s.bind("keyframes.baseline.few_close", &b.few_close, "[points] fewer tracked close points ...");
  s.bind("keyframes.baseline.many_creatable", &b.many_creatable,
         "[points] ... with so many to be made call for a keyframe");

  MappingOptions& m = o.mapping;
  s.bind("mapping.min_shared_points", &m.min_shared_points, "[points] that make two keyframes covisible");
  s.bind("mapping.min_found_ratio", &m.min_found_ratio, "found / visible below which a young point is dropped");
  s.bind("mapping.probation_keyframes", &m.probation_keyframes, "[keyframes] that a point is on probation");
  s.bind("mapping.min_observers", &m.min_observers, "keyframes that must see a point by then");
  s.bind("mapping.redundant_share", &m.redundant_share,
         "share of points seen elsewhere that makes a keyframe redundant");
  s.bind("mapping.redundant_observers", &m.redundant_observers, "by at least so many other keyframes");
  s.bind("mapping.fusion_keyframes", &m.fusion_keyframes,
         "covisible keyframes whose points are fused with a new one's");
  s.bind("mapping.fusion_radius", &m.fusion_radius, "[px] search for the same point");
  s.bind("mapping.creation.neighbours", &m.creation.neighbours, "covisible keyframes to triangulate with");
  s.bind("mapping.creation.min_parallax_deg", &m.creation.min_parallax_deg, "[deg] between the rays of a new point");
  s.bind("mapping.creation.max_distance", &m.creation.max_distance, "[bits] of an epipolar match");
  s.bind("mapping.creation.chi2_epipolar", &m.creation.chi2_epipolar, "squared epipolar distance over sigma^2");
  s.bind("mapping.creation.chi2_pixel", &m.creation.chi2_pixel, "squared reprojection error over sigma^2");
  s.bind("mapping.ba.free_keyframes", &m.ba.free_keyframes, "keyframes that local bundle adjustment moves");
  s.bind("mapping.ba.fixed_keyframes", &m.ba.fixed_keyframes, "others that see their points");
  s.bind("mapping.ba.iterations_first", &m.ba.iterations_first, "[steps] before outliers are told apart");
  s.bind("mapping.ba.iterations_second", &m.ba.iterations_second, "[steps] after");
  s.bind("mapping.ba.weighted", &m.ba.weighted, "geometric weights of points (DKB section 3.3)");
  s.bind("mapping.ba.edge_weight", &m.ba.weights.edge_weight,
         "weight of edge points where adaptive_weight is false (DKB Table 1)");
  s.bind("mapping.ba.adaptive_weight", &m.ba.weights.adaptive, "estimate the weight from the residuals");
  s.bind("mapping.ba.adaptive_min", &m.ba.weights.adaptive_min, "least such weight, 0 ... 1");
  s.bind("mapping.ba.adaptive_max", &m.ba.weights.adaptive_max, "largest such weight, at least 1");
  s.bind("mapping.ba.adaptive_redundancy", &m.ba.weights.adaptive_redundancy,
         "redundant measurements at which that estimate counts half");

  s.bind("mapping.seam_tolerance", &m.seam_tolerance, "factor on fusion's limits where a loop was just closed");

  LoopOptions& l = o.loop_closing.loop;
  s.bind("loop.enabled", &l.enabled, "close loops and merge maps");
  s.bind("loop.candidates", &l.candidates, "most alike keyframes that are verified");
  s.bind("loop.min_relative_similarity", &l.min_relative_similarity,
         "of a candidate, as a share of the most alike neighbour's score");
  s.bind("loop.neighbourhood", &l.neighbourhood, "steps along covisibility within which nothing is a loop");
  s.bind("loop.min_keyframes_between", &l.min_keyframes_between, "[keyframes] younger ones are no candidates");
  s.bind("loop.area_keyframes", &l.area_keyframes, "keyframes around a candidate whose points are matched");
  s.bind("loop.rest_keyframes", &l.rest_keyframes, "[keyframes] without a search after a loop");
  s.bind("loop.match_distance", &l.match_distance, "[bits] of a descriptor match");
  s.bind("loop.match_ratio", &l.match_ratio, "best over second best distance of such a match");
  s.bind("loop.min_ransac_inliers", &l.min_ransac_inliers, "pairs of points that one rigid motion explains");
  s.bind("loop.radius_first", &l.radius_first, "[px] guided search under that motion");
  s.bind("loop.radius", &l.radius, "[px] the same under the refined pose");
  s.bind("loop.min_inliers", &l.min_inliers, "map points that the refined pose rests on");
  s.bind("loop.min_share", &l.min_share, "of the well-known points that ought to be in view");
  s.bind("loop.min_support", &l.min_support, "keyframes around the newest that must see the same");
  s.bind("loop.support_keyframes", &l.support_keyframes, "of them asked at most");
  s.bind("loop.support_inliers", &l.support_inliers, "points of the area that such a keyframe must show");
  s.bind("loop.support_translation", &l.support_translation, "[m] by which they may differ");
  s.bind("loop.support_rotation", &l.support_rotation, "[deg] likewise");
  s.bind("loop.drift_translation_base", &l.drift_translation_base, "[m] largest plausible drift of no way ...");
  s.bind("loop.drift_translation_share", &l.drift_translation_share, "... and its growth with the way's length");
  s.bind("loop.drift_rotation_base", &l.drift_rotation_base, "[deg] the same of the direction");
  s.bind("loop.drift_rotation_per_metre", &l.drift_rotation_per_metre, "[deg/m] and its growth");
  s.bind("loop.merge_min_inliers", &l.merge_min_inliers, "min_inliers between maps that are not joined");
  s.bind("loop.merge_min_share", &l.merge_min_share, "min_share between maps that are not joined");
  s.bind("loop.essential_shared_points", &l.essential_shared_points,
         "[points] shared by keyframes that make an edge of the pose graph");
  s.bind("loop.edge_position_sd", &l.edge_position_sd, "[m] of such an edge ...");
  s.bind("loop.edge_position_share", &l.edge_position_share, "... and its growth with the edge's length");
  s.bind("loop.edge_rotation_sd", &l.edge_rotation_sd, "[rad] the same of the direction");
  s.bind("loop.edge_rotation_growth", &l.edge_rotation_growth, "[rad/m] and its growth");
  s.bind("loop.edge_rotation_share", &l.edge_rotation_share, "[1] and its growth with the edge's turn");
  s.bind("loop.graph_iterations", &l.graph_iterations, "steps of the pose graph's optimisation");
  s.bind("loop.latency", &o.loop_closing.loop_latency.base, "[s] until the result is used");
  s.bind("loop.latency_per_keyframe", &o.loop_closing.loop_latency.per_keyframe, "[s] more for each keyframe of the map");
  GlobalBaOptions& g = o.loop_closing.global_ba;
  s.bind("global_ba.iterations_first", &g.iterations_first, "[steps] before outliers are told apart");
  s.bind("global_ba.iterations_second", &g.iterations_second, "[steps] after");
  s.bind("global_ba.latency", &o.loop_closing.global_ba_latency.base, "[s] until the result is used");
  s.bind("global_ba.latency_per_keyframe", &o.loop_closing.global_ba_latency.per_keyframe, "[s] more for each keyframe of the map");
  s.bind("global_ba.final", &o.final_ba, "adjust the whole map once more at the end");

  s.bind("readout.estimate", &o.readout.estimate, "learn the rolling shutter's readout where the camera's is unknown");
  s.bind("readout.step_sd", &o.readout.step_sd, "[s] uncertainty of a step below which it is taken");
  s.bind("readout.max_readout", &o.readout.max_readout, "[s] largest readout believed in");

  DynamicsOptions& d = o.dynamics;
  s.bind("dynamics.filter", &d.filter,
         {{"none", FilterKind::none},
          {"box", FilterKind::box},
          {"epipolar", FilterKind::epipolar},
          {"multiview", FilterKind::multiview},
          {"paper", FilterKind::paper},
          {"default", FilterKind::standard}},
         "which features are kept from tracking");
  s.bind("dynamics.paper.flow_threshold", &d.rivals.paper.flow_threshold, "[px] d_th (DKB eq. 9)");
  s.bind("dynamics.paper.compensate", &d.rivals.paper.compensate,
         "flow against the camera's own motion; false = raw eq. 9");
  s.bind("dynamics.epipolar.threshold", &d.rivals.epipolar.threshold, "[px] distance to the epipolar line");
  s.bind("dynamics.multiview.depth_jump", &d.rivals.multiview.depth_jump, "[m] before what earlier keyframes saw");
  s.bind("dynamics.multiview.radius", &d.rivals.multiview.radius, "[px] around such a spot");
  s.bind("dynamics.multiview.keyframes", &d.rivals.multiview.keyframes, "earlier keyframes compared");
  s.bind("dynamics.silhouette.cell", &d.carried.silhouette.cell, "[px] grid on which depth is looked at");
  s.bind("dynamics.silhouette.core", &d.carried.silhouette.core, "share of a box in which the object is sought");
  s.bind("dynamics.silhouette.min_share", &d.carried.silhouette.min_share,
         "of the core's weight that the object's depth layer needs");
  s.bind("dynamics.silhouette.layer", &d.carried.silhouette.layer, "half-width of that layer relative to its depth");
  s.bind("dynamics.silhouette.depth_jump", &d.carried.silhouette.depth_jump, "relative depth step within one surface");
  s.bind("dynamics.silhouette.max_depth_offset", &d.carried.silhouette.max_depth_offset,
         "[m] parts of an object before or behind its layer");
  s.bind("dynamics.silhouette.margin", &d.carried.silhouette.margin, "share by which boxes are widened");
  s.bind("dynamics.silhouette.rim", &d.carried.silhouette.rim, "[cells] by which silhouettes are widened");
  s.bind("dynamics.motion.cell", &d.motion.cell, "[px] grid of the motion segmentation");
  s.bind("dynamics.motion.views_per_frame", &d.motion.views_per_frame, "past views compared with each frame");
  s.bind("dynamics.motion.settle", &d.motion.settle,
         "[s] a past view of the same surface says in proportion to its age, up to this, that it stands still");
  s.bind("dynamics.motion.memory", &d.motion.memory,
         "[s] time constant in which a mover that stands still is forgotten");
  s.bind("dynamics.motion.interior", &d.motion.interior,
         "weight of a surface being where a view had it, beside that of one in space seen empty, which is 1");
  s.bind("dynamics.motion.contour", &d.motion.contour, "the same of an outline");
  s.bind("dynamics.motion.smoothing.distance", &d.motion.smoothing.distance,
         "[m] along a surface over which cells of one object speak for each other");
  s.bind("dynamics.motion.smoothing.depth_jump_base", &d.motion.smoothing.depth_jump_base,
         "[m] depth step between neighbouring cells of one surface: this ...");
  s.bind("dynamics.motion.smoothing.depth_jump_slope", &d.motion.smoothing.depth_jump_slope,
         "... and this share of their depth");
  s.bind("dynamics.motion.smoothing.crease", &d.motion.smoothing.crease,
         "[1/m] second difference of inverse depth in a fold between object and support");
  s.bind("dynamics.motion.smoothing.crease_link", &d.motion.smoothing.crease_link,
         "share of what is said that crosses such a fold");
  s.bind("dynamics.motion.threshold", &d.motion.threshold, "score from which a cell moves");
  s.bind("dynamics.motion.rim", &d.motion.rim, "[cells] by which its mask is widened");
  s.bind("dynamics.motion.lone_hole", &d.motion.lone_hole,
         "share of the image from which missing depth may be a mover by itself");
  s.bind("dynamics.support_cell", &d.support_cell, "[px] the same when it only supports another detector");
  s.bind("dynamics.flow.window", &d.carried.flow.window, "[px] of optical flow");
  s.bind("dynamics.points_per_box", &d.carried.points_per_box, "features followed to carry a box");
  s.bind("dynamics.missed_results", &d.carried.missed_results,
         "detector results that may miss an object before its box is dropped");
  s.bind("dynamics.evidence_seconds", &o.evidence.seconds, "[s] on a mover before a map point is retracted");

  DenseOptions& v = o.dense;
  s.bind("dense.voxel", &v.voxel, "[m] side of a voxel of the dense map (--dense)");
  s.bind("dense.truncation", &v.truncation, "[m] distances to a surface are kept up to here");
  s.bind("dense.max_depth", &v.max_depth, "[m] depths beyond tell of free space only");
  s.bind("dense.pixel_step", &v.pixel_step, "[px] every how many pixels depth is kept of a keyframe");
  s.bind("dense.mover_margin", &v.mover_margin, "[px] around movers that is left out as well");
  s.bind("dense.edge_fraction", &v.edge_fraction, "[1] depths beside a step of this share are left out");
  s.bind("dense.min_views", &v.min_views, "keyframes that must see a surface");
  s.bind("dense.free_share", &v.free_share, "of a voxel's keyframes that may have seen through it");
  s.bind("dense.min_patch", &v.min_patch, "[m^2] smaller connected surfaces are dropped");
  s.bind("dense.grid_cell", &v.grid_cell, "[m] side of a cell of the occupancy grid");
  s.bind("dense.obstacle_low", &v.obstacle_low, "[m] above the floor: what is lower can be driven over");
  s.bind("dense.obstacle_high", &v.obstacle_high, "[m] what is higher can be driven under");
  s.bind("dense.obstacle_voxels", &v.obstacle_voxels, "surface voxels of that height that make a cell occupied");
  s.bind("dense.threads", &v.threads, "of the fusion; the result does not depend on it");

  s.bind("pipeline.mapper_latency", &o.pipeline.mapper_latency,
         "[s] after which a keyframe's mapping becomes visible, in whole frames");
  s.bind("pipeline.mapper_queue", &o.pipeline.mapper_queue, "[keyframes] outstanding at most in a real-time run");
}

Options::Options(const std::string& name) : values_(std::make_unique<SlamOptions>(preset(name))) {}
Options::Options(const Options& other)
    : threaded(other.threaded),
      realtime(other.realtime),
      dense_map(other.dense_map),
      base_from_cam(other.base_from_cam),
      values_(std::make_unique<SlamOptions>(*other.values_)) {}
Options& Options::operator=(const Options& other) {
  if (this == &other) return *this;
  threaded = other.threaded;
  realtime = other.realtime;
  dense_map = other.dense_map;
  base_from_cam = other.base_from_cam;
  *values_ = *other.values_;
  return *this;
}
Options::~Options() = default;

void Options::set(const std::string& key, const std::string& value, const std::string& where) {
  Settings settings;
  bind_settings(settings, *values_);
  settings.set(key, value, where.empty() ? "settings" : where);
}

void Options::assign(const std::string& assignment, const std::string& where) {
  Settings settings;
  bind_settings(settings, *values_);
  settings.set_assignment(assignment, where.empty() ? "settings" : where);
}

void Options::load(const std::filesystem::path& path) {
  Settings settings;
  bind_settings(settings, *values_);
  settings.load_yaml(path);
}

void Options::disable(const std::string& list) {
  const std::vector<std::string> known = {"dr", "kf", "ba", "loop"};
  DisabledParts parts;
  bool* const switches[] = {&parts.dynamic_removal, &parts.keyframes, &parts.weighted_ba, &parts.loop};
  std::istringstream names(list);
  for (std::string name; std::getline(names, name, ',');) {
    const auto at = std::find(known.begin(), known.end(), name);
    if (at == known.end())
      throw InputError("--disable: there is no part \"" + name + "\"" + did_you_mean(name, known) +
                       "; parts: dr, kf, ba, loop");
    *switches[at - known.begin()] = true;
  }
  disable_parts(*values_, parts);
}

std::string Options::to_yaml() const {
  SlamOptions values = *values_;
  Settings settings;
  bind_settings(settings, values);
  return settings.to_yaml();
}

void Options::check() const {
  values_->check();
}

}  // namespace dkb
