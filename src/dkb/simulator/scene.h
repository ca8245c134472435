// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dkb/simulator/camera_path.h"
#include "dkb/simulator/cells.h"
#include "dkb/simulator/furniture.h"
#include "dkb/simulator/movers.h"

namespace dkb::sim {

// Everything that a simulator shows. Scene frame: z up, floor at z = 0.
struct Scene {
  Materials materials;
  Furnishing furnishing;
  std::vector<Cell> cells;  // of large scenes, which have their furnishing here
  Surfaces glass;           // panes that only the depth sensor notices
  std::vector<Mover> movers;
  Footprint inside;  // walls of the room where people walk
  CameraPath path;   // scene_from_cam over seconds from the first frame
  Rigid3 world_from_scene;
  double start_stamp = 1700000000.0;  // [s] of the first frame
  int frames = 300;                   // at 30 Hz
  double exposure = 0.014;            // [s]
  double brightness = 1;              // of the pictures
  double photon_noise = 0;            // see Exposure
  std::vector<std::string> notes;
};

// What the command line says about a scene.
struct SceneRequest {
  std::string name;
  int frames = 0;   // at 30 Hz; 0: the scene's own
  int people = -1;  // -1: the scene's own
  uint64_t seed = 1;
  double fps = 30;
  double stand_still = 0;  // [s] people stand from the start
};

// A scene by name, with its own camera path; the name is valid.
Scene build_scene(const SceneRequest& request);

// The larger ones of them.
Scene build_corridor(const SceneRequest& request);
Scene build_building(const SceneRequest& request);

// A room furnished around a given camera path (poses in any frame whose up is z or, failing that, the pictures' average
// up), so that the camera sees furnished things 0.6 ... 3 m away.
Scene build_scene_around(const std::vector<TimedPose>& poses, const SceneRequest& request);

// Adds walkers that go where the camera looks. `area.inside`, `area.obstacles` and `area.camera` are filled in here.
void add_walkers(Scene* scene, WalkArea area, int count, double duration, const SceneRequest& request);
void add_mover(Scene* scene, const std::string& kind, Track track, uint64_t seed);

// A scene from a YAML file; docs/files.md has the format. `name` opens messages.
// Throws InputError with file:line: unknown (misspelt), repeated, missing or ill-typed key, value out of range, not
// YAML.
Scene parse_scene(const std::string& text, const std::string& name, const SceneRequest& request);
Scene read_scene_file(const std::string& file, const SceneRequest& request);

}  // namespace dkb::sim
