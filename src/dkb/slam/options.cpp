// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/options.h"

#include <algorithm>
#include <sstream>
#include <string_view>
#include <vector>

#include "dkb/image/given_motion.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr std::string_view kExperiment = "experiment.";

Range at_least(double min) {
  return {.min = min};
}
Range above(double min) {
  return {.min = min, .above_min = true};
}

// Visits every setting: its key, its public field, the stages' field, unit and meaning, and what it may be.
template <class Public, class Internal, class Visit>
void each_setting(Public& p, Internal& o, const Visit& visit) {
  visit("seed", p.seed, o.seed,
        "of the random draws in finding a lost camera, loops and the floor; results hardly ever depend on it");

  // Fewer than a point's name has room for (kMaxFeaturesPerFrame), since an image may give a few more than are wanted.
  visit("features.count", p.features.count, o.features.count, "[features] wanted per image", Range{1, 8000});
  visit("features.levels", p.features.levels, o.features.levels, "levels of the image pyramid", Range{1, 16});
  visit("features.scale", p.features.scale, o.features.scale, "size of a level over the next smaller one",
        Range{1, 4, true});
  visit("features.fast_threshold", p.features.fast_threshold, o.features.fast_threshold,
        "[grey levels] contrast of a corner, not below fast_threshold_min", Range{1, 254});
  visit("features.fast_threshold_min", p.features.fast_threshold_min, o.features.fast_threshold_min,
        "[grey levels] contrast of a corner where an image has none above fast_threshold", Range{1, 254});

  visit("noise.pixel_sigma", p.noise.pixel_sigma, o.noise.pixel_sigma,
        "[px] standard deviation of a corner on the finest level, where the focal length is 525 px", above(0));
  visit("noise.depth_sigma_base", p.noise.depth_sigma_base, o.noise.depth_sigma_base,
        "[m] standard deviation of depth at 0.4 m", above(0));
  visit("noise.depth_sigma_quadratic", p.noise.depth_sigma_quadratic, o.noise.depth_sigma_quadratic,
        "[1/m] growth of depth's standard deviation with (z - 0.4 m)^2", at_least(0));
  visit("noise.depth_sigma_factor", p.noise.depth_sigma_factor, o.noise.depth_sigma_factor,
        "factor on depth's standard deviation, for edges, registration and calibration", at_least(1));

  visit("tracking.close_depth", p.tracking.close_depth, o.tracking.close_depth,
        "[m] depths below make map points at once", above(0));
  visit("tracking.initial_points", p.tracking.initial_points, o.tracking.initial_points,
        "[features] with depth in a map's first frame", at_least(10));
  visit("tracking.min_inliers", p.tracking.min_inliers, o.tracking.min_inliers,
        "[points] that agree with a pose, half as many with one that was expected; with fewer, tracking is lost",
        at_least(6));
  visit("tracking.new_map_after", p.tracking.new_map_after, o.tracking.new_map_after,
        "[s] lost in a row until a new map is begun, 0 = never", at_least(0));

  visit("keyframes.policy", p.keyframes.policy, o.keyframe_policy, "who decides that a frame becomes a keyframe",
        Names<KeyframePolicyKind>{{"adaptive", KeyframePolicyKind::adaptive},
                                  {"baseline", KeyframePolicyKind::baseline}});
  visit("keyframes.min_frames_between", p.keyframes.min_frames_between, o.adaptive_keyframes.min_frames_between,
        "[frames] from a keyframe to the next, adaptive policy", at_least(1));

  visit("mapping.redundant_share", p.mapping.redundant_share, o.mapping.redundant_share,
        "share of a keyframe's points seen elsewhere that makes it redundant", Range{0, 1});
  visit("mapping.ba.free_keyframes", p.mapping.ba.free_keyframes, o.mapping.ba.free_keyframes,
        "[keyframes] moved by local bundle adjustment", at_least(1));
  visit("mapping.ba.fixed_keyframes", p.mapping.ba.fixed_keyframes, o.mapping.ba.fixed_keyframes,
        "[keyframes] held still by local bundle adjustment", at_least(1));
  visit("mapping.ba.weighted", p.mapping.ba.weighted, o.mapping.ba.weighted,
        "points weigh by their geometry in bundle adjustment, DKB section 3.3");

  visit("loop.enabled", p.loop.enabled, o.loop_closing.loop.enabled, "close loops and join maps");
  visit("loop.min_inliers", p.loop.min_inliers, o.loop_closing.loop.min_inliers,
        "[points] of the map that agree with a loop", at_least(10));
  visit("global_ba.final", p.global_ba.final, o.final_ba, "adjust the whole map once more at the end");
  visit("timing.estimate", p.timing.estimate, o.estimate_timing,
        "learn the rolling shutter's readout and the depth's time offset where the camera's file does not tell them");

  visit("dynamics.filter", p.dynamics.filter, o.dynamics.filter, "which features are kept from tracking",
        Names<FilterKind>{{"none", FilterKind::none},
                          {"box", FilterKind::box},
                          {"epipolar", FilterKind::epipolar},
                          {"multiview", FilterKind::multiview},
                          {"paper", FilterKind::paper},
                          {"default", FilterKind::standard}});
  visit("dynamics.motion.memory", p.dynamics.motion.memory, o.dynamics.motion.memory,
        "[s] time constant in which what stands still is no longer a mover", above(0));
  visit("dynamics.motion.threshold", p.dynamics.motion.threshold, o.dynamics.motion.threshold,
        "score from which a cell moves; a frame adds at most 1", Range{0, 2, true});

  visit("dense.voxel", p.dense.voxel, o.dense.voxel, "[m] side of a voxel of the dense map", Range{0.005, 0.2});
  visit("dense.truncation", p.dense.truncation, o.dense.truncation,
        "[m] distances to a surface are kept up to here, 2 to 20 voxels", above(0));
  visit("dense.max_depth", p.dense.max_depth, o.dense.max_depth, "[m] depths beyond tell of free space only",
        Range{0.5, 16});
  visit("dense.grid_cell", p.dense.grid_cell, o.dense.grid_cell,
        "[m] side of a cell of the occupancy grid, at least 2 voxels", Range{0.01, 1});
  visit("dense.obstacle_low", p.dense.obstacle_low, o.dense.obstacle_low,
        "[m] above the floor: what is lower can be driven over", above(0));
  visit("dense.obstacle_high", p.dense.obstacle_high, o.dense.obstacle_high,
        "[m] above the floor, above obstacle_low: what is higher can be driven under", above(0));

  visit("pipeline.mapper_latency", p.pipeline.mapper_latency, o.pipeline.mapper_latency,
        "[s] until tracking sees a keyframe's mapping, in whole frames", Range{0, 10, true});
  visit("pipeline.mapper_queue", p.pipeline.mapper_queue, o.pipeline.mapper_queue,
        "[keyframes] waiting for mapping at most, in a real-time run", at_least(1));
}

void bind_settings(Settings& settings, Options& options) {
  SlamOptions unused;
  each_setting(options, unused,
               [&](const char* key, auto& field, auto&, const auto&... rest) { settings.bind(key, &field, rest...); });
}

// What only presets, benches and studies of the method set.
void bind_experiments(Settings& s, SlamOptions& o) {
  s.bind("experiment.depth.model_time_offset", &o.depth.model_time_offset, "carry depths to the colour image's time");
  s.bind("experiment.depth.model_rolling_shutter", &o.depth.model_rolling_shutter, "undo the rolling shutter");

  AdaptiveKeyframeOptions& a = o.adaptive_keyframes;
  s.bind("experiment.keyframes.translation_unit", &a.translation_unit, "of translations in the gate",
         {{"centimetre", TranslationUnit::centimetre}, {"depth_percent", TranslationUnit::depth_percent}});
  s.bind("experiment.keyframes.similarity", &a.similarity, "S as the paper prints it or as its source has it (eq. 34)",
         {{"printed", Similarity::printed}, {"pks", Similarity::pks}});
  s.bind("experiment.keyframes.normals", &a.normals, "turned toward the camera or summed as printed (DKB eq. 28)",
         {{"oriented", NormalSum::oriented}, {"plain", NormalSum::plain}});

  s.bind("experiment.smooth_trajectory", &o.smooth_trajectory,
         "let the poses of the final trajectory smooth each other");

  GeometricWeightOptions& w = o.mapping.ba.weights;
  s.bind("experiment.mapping.ba.edge_weight", &w.edge_weight, "of edge points without adaptive_weight (DKB Table 1)",
         Range{0, 10, true});
  s.bind("experiment.mapping.ba.adaptive_weight", &w.adaptive, "estimate the weight from the residuals");

  s.bind("experiment.mapping.planes", &o.mapping.ba.planes, "flat surfaces take part in bundle adjustment");

  PaperFilterOptions& paper = o.dynamics.paper;
  s.bind("experiment.dynamics.paper.flow_threshold", &paper.flow_threshold, "[px] d_th (DKB eq. 9)", above(0));
  s.bind("experiment.dynamics.paper.compensate", &paper.compensate, "flow against the camera's own motion");
}

// Every setting, and the experiments that were set.
std::vector<SettingEntry> entries_of(const Options& options) {
  Options values;
  SlamOptions experimental;
  Settings settings;
  bind_settings(settings, values);
  bind_experiments(settings, experimental);
  values = options;
  for (const auto& [key, value] : options.experiments()) settings.set(key, value, "experiments");
  std::vector<SettingEntry> entries = settings.entries();
  std::erase_if(entries, [](const SettingEntry& e) { return e.key.starts_with(kExperiment) && e.where.empty(); });
  return entries;
}

// The stages' options that a preset stands for.
SlamOptions preset_options(const std::string& name, const std::string& where) {
  const std::vector<std::string> names = {"default", "paper", "orb"};
  SlamOptions o;
  if (name == "default") return o;
  if (name != "paper" && name != "orb")
    throw InputError(where + ": there is no preset \"" + name + "\"" + did_you_mean(name, names) +
                     "; presets: default, paper, orb");
  // What the paper does not have: the camera's own motion within an image, between images and over many, and planes.
  o.smooth_trajectory = false;
  o.depth.model_rolling_shutter = false;
  o.depth.model_time_offset = false;
  o.features.count = 1000;  // of every image, on as many levels as ORB-SLAM has
  o.features.levels = 8;
  o.dynamics.filter = FilterKind::paper;
  o.adaptive_keyframes = paper_keyframe_options();
  o.mapping.ba.weights.adaptive = false;
  o.mapping.ba.planes = false;
  if (name == "orb") {
    o.dynamics.filter = FilterKind::none;
    o.keyframe_policy = KeyframePolicyKind::baseline;
    o.mapping.ba.weighted = false;
  }
  return o;
}

}  // namespace

SlamOptions expand(const Options& options) {
  SlamOptions o = preset_options(options.preset(), "preset");
  each_setting(options, o, [](const char*, const auto& from, auto& to, const auto&...) { to = from; });
  Settings settings;
  bind_experiments(settings, o);
  for (const auto& [key, value] : options.experiments()) settings.set(key, value, "settings");
  o.pipeline.threaded = options.threaded;
  o.pipeline.realtime = options.realtime;
  o.dense_map = options.dense_map;
  o.base_from_cam = options.base_from_cam;
  o.base_from_cam.rotation.normalize();
  return o;
}

std::string settings_table() {
  Options options;
  Settings settings;
  bind_settings(settings, options);
  std::string table = "| key | unit | range | default | meaning |\n|---|---|---|---|---|\n";
  for (const SettingEntry& e : settings.entries())
    table += "| `" + e.key + "` | " + e.unit() + " | " + e.range + " | " + e.initial + " | " + e.meaning() + " |\n";
  return table;
}

Options::Options() {
  start_from("default", "preset");
}
Options::Options(const std::string& preset) {
  start_from(preset, "preset");
}

void Options::start_from(const std::string& preset, const std::string& where) {
  SlamOptions values = preset_options(preset, where);
  each_setting(*this, values, [](const char*, auto& to, const auto& from, const auto&...) { to = from; });
  preset_ = preset;
  experiments_.clear();
}

void Options::set(const std::string& key, const std::string& value, const std::string& where) {
  const std::string place = where.empty() ? "settings" : where;
  if (key == "preset") return start_from(value, place);
  SlamOptions experimental;
  Settings settings;
  bind_settings(settings, *this);
  bind_experiments(settings, experimental);
  if (!settings.has(key)) {
    const std::string experiment = std::string(kExperiment) + key;
    if (settings.has(experiment))  // as it was called in earlier versions
      throw InputError(place + ": \"" + key + "\" is \"" + experiment + "\" now, and not promised to stay");
    if (did_you_mean(key, settings.keys()).empty())
      throw InputError(place + ": unknown key \"" + excerpt(key) + "\"; docs/settings.md lists what can be set");
  }
  settings.set(key, value, place);
  if (key.starts_with(kExperiment)) experiments_[key] = value;
}

void Options::assign(const std::string& assignment, const std::string& where) {
  const auto [key, value] = split_assignment(assignment, where.empty() ? "settings" : where);
  set(key, value, where);
}

void Options::load(const std::filesystem::path& path) {
  Options keys;
  SlamOptions experimental;
  Settings settings;
  bind_settings(settings, keys);
  bind_experiments(settings, experimental);
  std::vector<SettingLine> lines = settings.parse_yaml(read_file(path), path.string());
  std::stable_partition(lines.begin(), lines.end(), [](const SettingLine& line) { return line.key == "preset"; });
  for (const SettingLine& line : lines) set(line.key, line.value, line.where);
}

void Options::disable(const std::string& list, const std::string& where) {
  const std::vector<std::string> known = {"dr", "kf", "ba", "loop"};
  std::string parts = list;
  std::erase(parts, ' ');
  std::istringstream names(parts);
  for (std::string name; std::getline(names, name, ',');) {
    if (name == "dr")
      dynamics.filter = FilterKind::none;
    else if (name == "kf")
      keyframes.policy = KeyframePolicyKind::baseline;
    else if (name == "ba")
      mapping.ba.weighted = false;
    else if (name == "loop")
      loop.enabled = false;
    else
      throw InputError((where.empty() ? "disable" : where) + ": there is no part \"" + name + "\"" +
                       did_you_mean(name, known) + "; parts: dr, kf, ba, loop");
  }
}

std::string Options::to_yaml() const {
  std::vector<SettingEntry> entries = entries_of(*this);
  for (SettingEntry& e : entries)
    e.doc += " (" + (e.range.empty() ? "" : e.range + "; ") + "default " + e.initial + ")";
  return "preset: " + preset_ + "  # what the settings below started from\n" + settings_yaml(entries);
}

std::vector<Setting> Options::settings() const {
  std::vector<Setting> all;
  for (SettingEntry& e : entries_of(*this))
    all.push_back(
        {e.key, e.value, e.initial, e.doc, e.kind, e.limits.min, e.limits.max, e.limits.above_min, e.choices});
  return all;
}

void Options::check() const {
  Options values = *this;
  Settings settings;
  bind_settings(settings, values);
  settings.check();
  require_option(features.fast_threshold >= features.fast_threshold_min, "features.fast_threshold",
                 features.fast_threshold, "at least features.fast_threshold_min");
  require_option(dense.truncation >= 2 * dense.voxel && dense.truncation <= 20 * dense.voxel, "dense.truncation",
                 dense.truncation, "2 ... 20 times dense.voxel");
  // Rays of a view would pass between the points of a wall whose cells are as narrow as what lies between these.
  require_option(dense.grid_cell >= 2 * dense.voxel, "dense.grid_cell", dense.grid_cell,
                 "at least 2 times dense.voxel");
  require_option(dense.obstacle_high > dense.obstacle_low, "dense.obstacle_high", dense.obstacle_high,
                 "above dense.obstacle_low");
  constexpr double kMountNorm = 1e-2;  // mounts are written by hand, to three digits
  if (!is_rigid(base_from_cam, kMountNorm))
    throw InvalidOption("base_from_cam",
                        "a motion with a quaternion of length " + std::to_string(base_from_cam.rotation.norm()),
                        "of finite numbers, with a quaternion of length 1; normalise it");
}

}  // namespace dkb
