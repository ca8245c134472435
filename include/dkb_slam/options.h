// SPDX-License-Identifier: Apache-2.0
/// \file
/// What can be set: options, and a rule of one's own for keyframes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "dkb_slam/geometry.h"
#include "dkb_slam/version.h"

namespace dkb {

/// Which features are kept from tracking: one family per way that published systems answer it, on the same back end.
/// Movers (FrameResult::movers) are told by `standard` alone.
enum class FilterKind {
  none,       ///< nothing is removed
  box,        ///< every feature in a box of a movable class (as Crowd-SLAM does)
  epipolar,   ///< features in boxes that leave their epipolar lines (as DS-SLAM and SG-SLAM do)
  multiview,  ///< features before surfaces that earlier keyframes saw (as DynaSLAM's geometry does)
  paper,      ///< flow residual and Gaussian depth test in boxes (DKB section 3.1)
  standard,   ///< silhouettes by depth and motion: our own; "default" in text
};

/// Who decides that a frame becomes a keyframe.
enum class KeyframePolicyKind {
  adaptive,  ///< parallax, match quality and visibility (DKB section 3.2)
  baseline,  ///< fewer than 85% of the reference keyframe's points, or few near ones (ORB-SLAM2)
};

/// Of which type a setting is.
enum class SettingKind {
  boolean,  ///< "true" or "false"
  whole,    ///< a whole number
  number,   ///< any finite number
  name,     ///< one of its choices
};

/// One setting as it stands, for programs that show, declare or document all of them.
struct Setting {
  std::string key;      ///< as in config.yaml, with dots: "features.count"
  std::string value;    ///< as text that Options::set() takes
  std::string initial;  ///< the same of preset "default"
  std::string meaning;  ///< with the unit in front: "[m] side of a voxel of the dense map"
  SettingKind kind = SettingKind::number;
  double min = -std::numeric_limits<double>::infinity();  ///< of a number; infinite where no limit is set
  double max = std::numeric_limits<double>::infinity();   ///< likewise
  bool above_min = false;                                 ///< `min` itself is out
  std::vector<std::string> choices = {};                  ///< of a name
};

/// The settings of config.yaml, by the names they have there, and what programs alone set. Fields may be set directly;
/// check() and Slam's constructor judge them. docs/settings.md is the same list as a table.
class DKB_SLAM_API Options {
 public:
  /// Of the random draws in finding a lost camera, loops and the floor; results hardly ever depend on it.
  uint64_t seed = 1;

  struct Features {
    int count = 900;             ///< [features] wanted per image, 1 ... 8000
    int levels = 7;              ///< of the image pyramid, 1 ... 16
    double scale = 1.2;          ///< size of a level over the next smaller one, above 1, at most 4
    int fast_threshold = 20;     ///< [grey levels] contrast of a corner, fast_threshold_min ... 254
    int fast_threshold_min = 7;  ///< [grey levels] the same where an image has no such corners, 1 ... 254
  } features;

  struct Noise {
    double pixel_sigma = 1.0;          ///< [px, at a focal length of 525 px] standard deviation of a corner, above 0
    double depth_sigma_base = 0.0012;  ///< [m] standard deviation of depth at 0.4 m, above 0
    double depth_sigma_quadratic = 0.0019;  ///< [1/m] its growth with (z - 0.4 m)^2, at least 0
    double depth_sigma_factor = 10.0;       ///< on both, for edges, registration and calibration, at least 1
  } noise;

  struct Tracking {
    double close_depth = 6.0;  ///< [m] depths below make map points at once, above 0
    int initial_points = 100;  ///< [features] with depth that a map's first frame needs, at least 10
    int min_inliers = 20;      ///< [points] that a pose rests on, at least 6; half as many where depth or a prior
                               ///< expects it; with fewer tracking is lost
    double new_map_after = 1;  ///< [s] lost in a row until a new map is begun; 0 = never, at least 0
  } tracking;

  struct Keyframes {
    KeyframePolicyKind policy = KeyframePolicyKind::adaptive;  ///< who decides that a frame becomes a keyframe
    int min_frames_between = 2;  ///< [frames] from a keyframe to the next (adaptive policy), at least 1
  } keyframes;

  struct Mapping {
    double redundant_share = 0.9;  ///< of a keyframe's points seen elsewhere that makes it redundant, 0 ... 1
    struct LocalBa {
      int free_keyframes = 12;   ///< [keyframes] that local bundle adjustment moves, at least 1
      int fixed_keyframes = 20;  ///< [keyframes] held still beside them, at least 1
      bool weighted = true;      ///< points weigh by their geometry (DKB section 3.3)
    } ba;
  } mapping;

  struct Loop {
    bool enabled = true;   ///< close loops and join maps
    int min_inliers = 50;  ///< [points] of the map that a loop rests on, at least 10
  } loop;

  struct GlobalBa {
    bool final = false;  ///< adjust the whole map once more at the end
  } global_ba;

  struct Timing {
    bool estimate = true;  ///< learn the readout and the depth's time offset where the camera does not tell them
  } timing;

  struct Dynamics {
    FilterKind filter = FilterKind::standard;  ///< which features are kept from tracking
    struct Motion {
      double memory = 6;       ///< [s] time constant in which what stands still is no longer a mover, above 0
      double threshold = 0.5;  ///< score from which a cell moves; a frame adds at most 1, above 0, at most 2
    } motion;
  } dynamics;

  struct Dense {
    double voxel = 0.02;          ///< [m] side of a voxel of the dense map, 0.005 ... 0.2
    double truncation = 0.06;     ///< [m] distances to a surface are kept up to here, 2 ... 20 voxels
    double max_depth = 4.0;       ///< [m] depths beyond tell of free space only, 0.5 ... 16
    double grid_cell = 0.05;      ///< [m] side of a cell of the occupancy grid, 0.01 ... 1, at least 2 voxels
    double obstacle_low = 0.10;   ///< [m] above the floor: what is lower can be driven over, above 0
    double obstacle_high = 1.50;  ///< [m] what is higher can be driven under, above obstacle_low
  } dense;

  struct Pipeline {
    double mapper_latency = 0.1;  ///< [s] until tracking sees a keyframe's mapping, in frames, above 0, at most 10
    int mapper_queue = 4;         ///< [keyframes] that may wait for mapping in a real-time run, at least 1
  } pipeline;

  bool threaded = true;  ///< mapping, detection and loop search on threads of their own; false: the same bytes from one
  bool realtime = false;   ///< never wait for them but for the first detection; results may differ from run to run
  bool dense_map = false;  ///< keep what Slam::dense_map() needs: about 0.5 MB per keyframe
  /// Mount: the world is the robot's base at the first tracked frame (a loaded map's stays). Of finite numbers; the
  /// length of its quaternion may be 1e-2 off 1, and is made 1.
  Rigid3 base_from_cam;

  Options();  ///< starts from "default", our best
  /// Starts from "default"; "paper", DKB-SLAM as printed; or "orb", that without its three contributions. Throws
  /// InputError naming the nearest one.
  explicit Options(const std::string& preset);
  const std::string& preset() const { return preset_; }

  /// Sets one setting from text ("features.count", "1200"), or "preset", which sets all of them. Keys that begin with
  /// "experiment." reach what only studies of the method change; they are not promised to last. `where` opens the
  /// message of what it throws: InputError for an unknown key, with the nearest one, and for a value of another type;
  /// InvalidOption for one out of range.
  void set(const std::string& key, const std::string& value, const std::string& where = "");
  /// Sets "key=value".
  void assign(const std::string& assignment, const std::string& where = "");
  /// Sets what a YAML file holds, as written by to_yaml(), its preset first. Throws InputError with file and line.
  void load(const std::filesystem::path& path);
  /// Switches parts off, by comma: dr (rejecting what moves), kf (adaptive keyframes), ba (weighted bundle adjustment),
  /// loop (loop closing). Blanks do not matter. Throws InputError for any other, which `where` opens.
  void disable(const std::string& parts, const std::string& where = "");
  /// The preset and every setting, a line each with its unit, meaning, range and default; experiments that were set.
  std::string to_yaml() const;
  /// The same as a list, by key, without the preset.
  std::vector<Setting> settings() const;
  /// Throws InvalidOption naming the whole key.
  void check() const;

  /// What was set of "experiment.", by key.
  const std::map<std::string, std::string>& experiments() const { return experiments_; }

 private:
  void start_from(const std::string& preset, const std::string& where);

  std::string preset_;
  std::map<std::string, std::string> experiments_;
};

/// A map point that the frame shows.
struct TrackedPoint {
  Eigen::Vector2f pixel;              ///< [px] ideal (undistorted), in the frame
  Eigen::Vector3d position_in_world;  ///< [m]
  int keyframes = 0;                  ///< that see it; 0 = mapping has not worked it in yet
  bool in_last_keyframe = false;      ///< the last keyframe shows it as well
};

/// What a rule may know of a tracked frame.
struct KeyframeQuery {
  int frame = 0;                      ///< index of the frame
  int64_t stamp_ns = 0;               ///< of its colour image
  int frames_since_keyframe = 0;      ///< since the last keyframe
  double seconds_since_keyframe = 0;  ///< [s] likewise; of a loaded map's since the camera was found there
  bool mapper_idle = true;            ///< the last keyframe and what loops move are in the map
  int tracked_close_points = 0;       ///< points of the pose that are near enough for good depth
  int creatable_close_points = 0;     ///< features near enough that show no map point yet
  int reference_points = 0;           ///< points of the reference keyframe that other keyframes see as well
  Rigid3 world_from_cam;              ///< the frame's pose
  Rigid3 world_from_last_keyframe;    ///< the last keyframe's camera
  std::vector<TrackedPoint> points;   ///< inliers of the pose
};

/// The answer, with the numbers that led to it.
struct KeyframeAnswer {
  bool insert = false;      ///< the frame becomes a keyframe
  std::string explanation;  ///< for logs; may be empty
};

/// Decides whether a tracked frame becomes a keyframe. Called for every tracked frame but a map's first, on the feeding
/// thread. Runs are repeatable as far as the same queries in the same order give the same answers.
class DKB_SLAM_API KeyframePolicy {
 public:
  virtual ~KeyframePolicy() = default;
  /// What it throws leaves Slam::process(), as an InputError, and ends this world until reset() or load_map().
  virtual KeyframeAnswer decide(const KeyframeQuery& query) = 0;
  /// The map starts anew: Slam was made, reset or given a map.
  virtual void reset() {}
};

}  // namespace dkb
