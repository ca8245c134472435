// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "dkb/dynamics/motion_depth_grid.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

struct MotionOptions {
  int cell = 4;                   // [px] 2 ... 16
  int views = 8;
  int views_per_frame = 3;
  double view_interval = 0.2;     // [s]
  double tolerance_base = 0.02, tolerance_sigmas = 6;
  double on = 0.5;
  double memory = 6.0;  // [s]
  double reach = 0.4;  // [m]
  double near_range = 0.7, hole_memory = 1;
  double hole_prior = 0.02;
  double slope = 1;
  double prior = 0.01;
  double state = 0.02, age = 0.5;
  double interior = 0.02, contour = 0.3, low = 1.5;
  double crease = 0.012;  // [1/m]
  double full_evidence = 0.05;
  void check() const;
};

class MotionSegmenter {
 public:
  MotionSegmenter(const CameraModel& camera, const MotionOptions& options);
  MoverMask segment(const std::shared_ptr<const RgbdImage>& image, const Rigid3& cam_from_world_predicted);
  void commit(const std::optional<Rigid3>& cam_from_world);
  void reset();
  // dev
  Image<float> votes_, plus_;
  const Image<float>& score() const { return (current_ ? current_ : previous_)->score; }

 private:
  struct Pose { double time; Rigid3 cam_from_world; };
  Rigid3 at_depth_time(const Rigid3& cam_from_world, double time, double depth_time) const;
  void carry();
  void compare(const MotionDepthGrid& view);
  void decide();
  MoverMask mask() const;

  CameraModel camera_;
  MotionOptions options_;
  MotionRays rays_;
  std::unique_ptr<MotionDepthGrid> current_, previous_;
  std::deque<std::unique_ptr<MotionDepthGrid>> views_;  // oldest first
  std::vector<std::unique_ptr<MotionDepthGrid>> spare_;
  std::optional<Pose> last_;
  double image_time_ = 0, depth_time_ = 0;
  size_t turn_ = 0;
  Image<float> tolerance_;
  int frames_ = 0;
  Image<float> hole_share_, known_, match_, still_, link_x_, link_y_, num_, den_, inverse_, crease_;
};

}  // namespace dkb
