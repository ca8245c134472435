// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dkb/dense/dense_options.h"
#include "dkb/dense/depth_view.h"
#include "dkb/dense/occupancy_grid.h"
#include "dkb/dense/surface_mesh.h"
#include "dkb/geometry/sensor_noise.h"

namespace dkb {

// A pose of the finished trajectory.
struct TimedPose {
  double timestamp = 0;  // [s]
  Rigid3 world_from_cam;
};

// The dense map of the still world. Keyframes are noted as they come, cheaply, and fused when the poses are final, so
// that loop corrections count. Not thread-safe, but a copy is cheap and may be built on another thread. Deterministic.
class DenseMapper {
 public:
  DenseMapper(const CameraModel& camera, const SensorNoise& noise, const DenseOptions& options);

  // `depth_time` [s]: when the colour camera saw what the depth image shows. `movers`: where movers are seen in
  // `image`.
  void add_keyframe(FrameIndex frame, const RgbdImage& image, double depth_time, const MoverMask& movers);
  // Movers of an earlier frame that became known later. Frames that were not added are passed over.
  void remove_movers(FrameIndex frame, const MoverMask& movers);

  // Poses by time, of colour images; a view takes its pose at its depth image's time from them and is left out when
  // they do not reach within 0.2 s of it. `seed` is that of the floor's RANSAC. The floor's normal is looked for within
  // 35 degrees of up: the z axis of the robot's base, or -y of the cameras where `base_from_cam` turns nothing.
  DenseMap build(std::span<const TimedPose> trajectory, uint64_t seed, const Rigid3& base_from_cam = {}) const;

 private:
  SensorNoise noise_;
  DenseOptions options_;
  DepthViewMaker maker_;
  std::vector<std::shared_ptr<const DepthView>> views_;  // by increasing frame; copies of the mapper share them
};

}  // namespace dkb
