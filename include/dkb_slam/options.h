// SPDX-License-Identifier: Apache-2.0
/// \file
/// What can be set.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "dkb_slam/geometry.h"
#include "dkb_slam/version.h"

namespace dkb {

struct SlamOptions;  // the library's own

/// Settings by their keys, as they stand in config.yaml and docs/settings.md, and what is set by programs alone.
class DKB_SLAM_API Options {
 public:
  /// Starts from "default", our best; "paper", DKB-SLAM as printed; or "orb", that without its three contributions.
  /// Throws InputError naming the nearest one.
  explicit Options(const std::string& preset = "default");
  Options(const Options& other);
  Options& operator=(const Options& other);
  ~Options();

  bool threaded = true;  ///< mapping, detection and loop search on threads of their own; false: the same bytes from one
  bool realtime = false;   ///< never wait for them but for the first detection; results may differ from run to run
  bool dense_map = false;  ///< keep what Slam::dense_map() needs: about 0.5 MB per keyframe
  Rigid3 base_from_cam;    ///< mount: the world is the robot's base at the first tracked frame

  /// Sets one setting from text ("features.count", "1200"). `where` opens the message of what it throws: InputError for
  /// an unknown key, with the nearest one, for a value of another type, or one out of range.
  void set(const std::string& key, const std::string& value, const std::string& where = "");
  /// Sets "key=value".
  void assign(const std::string& assignment, const std::string& where = "");
  /// Sets what a YAML file holds, as written by to_yaml(). Throws InputError with file and line.
  void load(const std::filesystem::path& path);
  /// Switches parts off, by comma: dr (rejecting what moves), kf (adaptive keyframes), ba (weighted bundle adjustment),
  /// loop (loop closing).
  void disable(const std::string& parts);
  /// Every setting with its value and meaning, sorted by key.
  std::string to_yaml() const;
  /// Throws InvalidOption naming the whole key.
  void check() const;

  SlamOptions& internal() { return *values_; }
  const SlamOptions& internal() const { return *values_; }

 private:
  std::unique_ptr<SlamOptions> values_;
};

}  // namespace dkb
