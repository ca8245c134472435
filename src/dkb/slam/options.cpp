// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/options.h"

#include "dkb/util/errors.h"

namespace dkb {

void PipelineOptions::check() const {
  require_option(mapper_latency >= 1, "pipeline.mapper_latency", mapper_latency, "at least 1 frame");
  require_option(mapper_queue >= 1, "pipeline.mapper_queue", mapper_queue, "at least 1");
}

void SlamOptions::check() const {
  features.check();
  depth.check();
  noise.check();
  tracking.check();
  baseline_keyframes.check();
  mapping.check();
  pipeline.check();
}

SlamOptions preset(const std::string& name) {
  const std::vector<std::string> names = {"default"};
  if (name == "default") return {};
  throw InputError("--preset: there is no preset \"" + name + "\"" + did_you_mean(name, names) + "; presets: default");
}

void bind_settings(Settings& s, SlamOptions& o) {
  s.bind("seed", &o.seed, "reaches every source of randomness");

  s.bind("features.count", &o.features.count, "[features] wanted per image");
  s.bind("features.levels", &o.features.levels, "pyramid levels");
  s.bind("features.scale", &o.features.scale, "size of a pyramid level over the next smaller one");
  s.bind("features.fast_threshold", &o.features.fast_threshold, "[grey levels] corner threshold");
  s.bind("features.fast_threshold_min", &o.features.fast_threshold_min, "[grey levels] threshold of cells without corners");
  s.bind("features.subpixel", &o.features.subpixel, "refine corners below the pixel");

  s.bind("depth.edge_fraction", &o.depth.edge_fraction, "[1] depth step in a 3 x 3 window that voids a depth");
  s.bind("depth.model_time_offset", &o.depth.model_time_offset, "carry depths to the colour image's time");

  s.bind("depth.model_rolling_shutter", &o.depth.model_rolling_shutter, "undo the rolling shutter (needs the camera's readout)");

  s.bind("noise.pixel_sigma", &o.noise.pixel_sigma, "[px] of a corner on the finest level");
  s.bind("noise.depth_sigma_base", &o.noise.depth_sigma_base, "[m] depth noise at 0.4 m");
  s.bind("noise.depth_sigma_quadratic", &o.noise.depth_sigma_quadratic, "[1/m] growth with (z - 0.4 m)^2");
  s.bind("noise.depth_sigma_factor", &o.noise.depth_sigma_factor, "factor on both for edges, registration, calibration");

  TrackingOptions& t = o.tracking;
  s.bind("tracking.initial_points", &t.initial_points, "features with depth that the first frame needs");
  s.bind("tracking.least_matches", &t.least_matches, "matches with the last frame that make a pose worth trying");
  s.bind("tracking.least_inliers", &t.least_inliers, "inliers of a pose; fewer: lost");
  s.bind("tracking.least_inliers_found_again", &t.least_inliers_found_again, "the same after a loss");
  s.bind("tracking.close_depth", &t.close_depth, "[m] depths below make map points at once");
  s.bind("tracking.least_new_points", &t.least_new_points, "nearest depths that make points whatever close_depth says");
  s.bind("tracking.radius_last_frame", &t.radius_last_frame, "[px] search around the predicted position");
  s.bind("tracking.radius_wide", &t.radius_wide, "[px] second try");
  s.bind("tracking.radius_local_map", &t.radius_local_map, "[px] search for local map points");
  s.bind("tracking.match_distance", &t.match_distance, "[bits] of a match with a map point");
  s.bind("tracking.match_ratio", &t.match_ratio, "best over second best distance of such a match");
  s.bind("tracking.refresh_frames", &t.refresh_frames, "[frames] between choices of local map points, at most");
  s.bind("tracking.recovery_keyframes", &t.recovery_keyframes, "newest keyframes that a lost tracker tries");
  s.bind("tracking.local_map.voted_keyframes", &t.local_map.voted_keyframes, "keyframes that share most points with the frame");
  s.bind("tracking.local_map.neighbours_of_each", &t.local_map.neighbours_of_each, "covisible keyframes added for each");
  s.bind("tracking.local_map.keyframes", &t.local_map.keyframes, "keyframes of the local map, at most");

  BaselineKeyframeOptions& b = o.baseline_keyframes;
  s.bind("keyframes.baseline.frames_between", &b.frames_between, "[frames] longest wait while mapping is busy");
  s.bind("keyframes.baseline.least_tracked", &b.least_tracked, "[points] fewer make no keyframe");
  s.bind("keyframes.baseline.reference_ratio", &b.reference_ratio, "share of the reference's points below which a keyframe is due");
  s.bind("keyframes.baseline.few_close", &b.few_close, "[points] fewer tracked close points ...");
  s.bind("keyframes.baseline.many_creatable", &b.many_creatable, "[points] ... with so many to be made call for a keyframe");

  MappingOptions& m = o.mapping;
  s.bind("mapping.least_shared_points", &m.least_shared_points, "[points] that make two keyframes covisible");
  s.bind("mapping.least_found_ratio", &m.least_found_ratio, "found / visible below which a young point is dropped");
  s.bind("mapping.probation_keyframes", &m.probation_keyframes, "[keyframes] that a point is on probation");
  s.bind("mapping.least_observers", &m.least_observers, "keyframes that must see a point by then");
  s.bind("mapping.redundant_share", &m.redundant_share, "share of points seen elsewhere that makes a keyframe redundant");
  s.bind("mapping.redundant_observers", &m.redundant_observers, "by at least so many other keyframes");
  s.bind("mapping.fusion_keyframes", &m.fusion_keyframes, "covisible keyframes whose points are fused with a new one's");
  s.bind("mapping.fusion_radius", &m.fusion_radius, "[px] search for the same point");
  s.bind("mapping.creation.neighbours", &m.creation.neighbours, "covisible keyframes to triangulate with");
  s.bind("mapping.creation.least_parallax_deg", &m.creation.least_parallax_deg, "[deg] between the rays of a new point");
  s.bind("mapping.creation.max_distance", &m.creation.max_distance, "[bits] of an epipolar match");
  s.bind("mapping.creation.chi2_epipolar", &m.creation.chi2_epipolar, "squared epipolar distance over sigma^2");
  s.bind("mapping.creation.chi2_pixel", &m.creation.chi2_pixel, "squared reprojection error over sigma^2");
  s.bind("mapping.ba.free_keyframes", &m.ba.free_keyframes, "keyframes that local bundle adjustment moves");
  s.bind("mapping.ba.fixed_keyframes", &m.ba.fixed_keyframes, "others that see their points");
  s.bind("mapping.ba.iterations_first", &m.ba.iterations_first, "[steps] before outliers are told apart");
  s.bind("mapping.ba.iterations_second", &m.ba.iterations_second, "[steps] after");
  s.bind("mapping.ba.weighted", &m.ba.weighted, "geometric weights of points (DKB section 3.3)");
  s.bind("mapping.ba.edge_weight", &m.ba.weights.edge_weight, "weight of edge points (DKB Table 1)");
  s.bind("mapping.ba.adaptive_weight", &m.ba.weights.adaptive, "estimate the weight from the residuals instead");

  s.bind("pipeline.mapper_latency", &o.pipeline.mapper_latency, "[frames] after which a keyframe's mapping becomes visible");
  s.bind("pipeline.mapper_queue", &o.pipeline.mapper_queue, "[keyframes] outstanding at most in a real-time run");
}

}  // namespace dkb
