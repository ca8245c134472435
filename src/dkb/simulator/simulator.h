// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

struct SimulatorOptions {
  std::string scene = "room";  // a name of simulator_scenes(), or a YAML scene file (anything with a '.' or a '/')
  std::string path;            // trajectory file in TUM format that the camera follows; empty: the scene's own path
  int frames = 0;        // >= 0; 0: as many as the scene needs (300 at 30 Hz; loop, twins, corridor 900; building 6000)
  double rate = 30;      // [Hz] 1 ... 60; the motion is the same in seconds
  double dropouts = 0;   // 0 ... 0.9, share of the frames that is missing, singly and in bursts; never the first
  bool flicker = false;  // exposure jumps, lamps at 100 Hz
  double stand_still = 0;         // [s] 0 ... 3600; people stand from the start, half of them in view, then walk off
  int people = -1;                // 0 ... 30 walkers; -1: as many as the scene has by itself
  uint64_t seed = 1;              // of everything random: furniture, people, tremor, noise
  int width = 640, height = 480;  // [px] 64 ... 4096; the field of view stays that of a Kinect (fx = 525 at 640)
  double exposure = 0;            // [s] 0.001 ... 0.03; 0: the scene's own, 0.010 ... 0.020
  // [s] from the first to the last row of the colour image (rolling shutter; stamps are those of the middle row), 0 ...
  // 0.033. No camera file tells it, as none does for recorded sequences: the default makes fr1_xyz's path, drawn anew,
  // about as hard as the real clip, whose rolling shutter is longer but mostly modelled.
  double readout = 0.018;
  double grey_noise = 2.4;  // [grey levels] standard deviation of the sensor noise of the grey image, 0 ... 20
  double blackout_start = 0, blackout_seconds = 0;  // [s] from the first frame: colour and depth are black, >= 0
  // Wheel odometry beside the frames: its error in length, as a share, and in heading [rad/m], -0.5 ... 0.5; nothing =
  // there is none.
  std::optional<double> odometry_drift;
  bool depth_noise = true;  // noise, disparity steps and holes of a structured-light sensor

  void check() const;  // throws InvalidOption
};

// room crowd loop spin rush straight cover chair twins corridor dim building
const std::vector<std::string>& simulator_scenes();

// What moves by itself, as seen in one frame.
struct SimulatedMover {
  int id = 0;                                               // the same in all frames, from 1
  std::string kind;                                         // class: person, chair ...
  Eigen::Vector3d position_in_world;                        // [m] median of its visible surface points, per coordinate
  Eigen::Vector3d velocity_in_world;                        // [m/s] of the body as a whole
  int box_x = 0, box_y = 0, box_width = 0, box_height = 0;  // [px] bounds of its visible pixels
};

struct SimulatedFrame {
  std::string stamp, depth_stamp;  // [s] with 6 decimals
  RgbdImage image;                 // as the sensor gives it; the depth is that of the 16-bit file, exactly
  GreyImage mask;                  // 255 = mover, at the middle of the exposure
  DepthImage true_depth;           // [m] without noise, seen from world_from_cam at the colour stamp; 0 = nothing there
  std::vector<SimulatedMover> movers;  // visible ones, by id
  Rigid3 world_from_cam;               // truth at the colour stamp, the middle of the exposure
};

// Synthetic RGB-D sequences: furnished rooms with procedural textures and articulated people, drawn by exact ray
// intersection, seen by a sensor with the weaknesses of a hand-held Kinect: motion blur, rolling shutter, grey noise,
// depth noise after Nguyen, Izadi, Lovell 2012 ("Modeling Kinect Sensor Noise", 3DIMPVT), disparity steps of 1/8 px,
// holes at edges and on dark or slanted surfaces, colour and depth up to 16 ms apart. The world of the poses has z up,
// or is that of `path`.
//
// Deterministic: the same options give the same frames. Frames do not depend on each other; render() is thread-safe.
class Simulator {
 public:
  // Builds the scene. Throws InputError: unknown scene (naming the nearest), bad scene or trajectory file (file:line).
  explicit Simulator(const SimulatorOptions& options);
  ~Simulator();
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;

  int frames() const;
  const CameraModel& camera() const;
  double exposure() const;  // [s]
  std::optional<double> odometry_drift() const;
  Eigen::Vector3d up_in_world() const;  // a unit vector
  // Remarks for the user, one line each, e.g. that a path was shorter than the frames asked for.
  const std::vector<std::string>& notes() const;

  SimulatedFrame render(int index) const;  // 0 <= index < frames()
  // The same without true_depth, which stays empty: faster.
  SimulatedFrame render_without_true_depth(int index) const;

  // Truth at any time [s] from the first frame's stamp.
  Rigid3 world_from_cam(double seconds) const;
  double stamp(int index) const;  // [s] of the colour image
  bool black(int index) const;    // the frame lies in the blackout
  // Distance of the camera from the nearest mover's middle axis [m] at that time; infinity without movers.
  double nearest_mover(double seconds) const;

 private:
  SimulatedFrame render(int index, bool with_true_depth) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dkb
