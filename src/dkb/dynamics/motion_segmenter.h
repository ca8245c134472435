// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "dkb/dynamics/motion_depth_grid.h"
#include "dkb/dynamics/motion_smoothing.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

struct MotionOptions {
  int cell = 4;                 // [px] side of the cells that are judged, 2 ... 32
  int views = 8;                // past views kept, >= 2
  int views_per_frame = 4;      // of them compared with each frame, in turn, >= 1
  double view_interval = 0.2;   // [s] between views when they are taken; with age they thin out, > 0
  double view_age = 15;         // [s] older views are dropped, so that a parked chair becomes part of the room, > 0
  double tolerance = 0.02;      // [m] what poses and calibration may be off in depth, >= 0
  double tolerance_sigmas = 6;  // standard deviations of the sensor's depth noise on flat walls (SensorNoise), >= 0
  double slope = 1;             // share of a view's depth range over 3 x 3 cells added to the tolerance, >= 0
  double settle = 0.5;          // [s] agreement with a view counts in proportion to its age up to this, > 0
  double memory = 6;            // [s] time constant in which a mover that stands still is forgotten, > 0
  double hole_memory = 1;       // [s] the same for what is too near for the sensor, > 0
  double revision = 0.1;  // share of its own verdict that a view gives up for today's on the same surface, 0 ... 1
  // Weights of evidence beside that of an intrusion into space seen empty, which is 1. All >= 0.
  double contour = 0.3;         // an outline that is where a view had it: still
  double interior = 0.1;        // a surface that is where a view had it: still, but so is the inside of one that sways
  double state = 0.02;          // what the cell was before
  double prior = 0.015;         // nothing moves until something says so
  double hole_prior = 0.02;     // the same where depth is missing
  double full_evidence = 0.05;  // mean weight around a cell at which one frame says all it can, > 0
  double threshold = 0.5;       // score from which a cell moves; one frame adds at most 1, (0, 2]
  double lone_hole = 0.05;      // share of the image from which missing depth moves though no measured mover touches it
  int rim = 0;                  // [cells] the mask is widened by, >= 0
  MotionSmoothingOptions smoothing;
  void check() const;  // throws InvalidOption
};

// Finds what moves against the camera's own motion, of any class, without a model: people, a pushed chair, a carried
// box. A surface in space that an earlier view saw empty has come in; its evidence is shared with what it hangs
// together with, and carried along with the surface, so that who stops moving stays marked for seconds. Who is there
// from the first frame is found once his outline has moved by some cells, large things later than small ones.
//
// Works on depth alone, on a coarse grid. Deterministic. Keeps its buffers from frame to frame; one object per thread.
// Calls alternate: segment() or observe() with the expected pose, then commit() with the one that tracking found.
class MotionSegmenter {
 public:
  explicit MotionSegmenter(const CameraModel& camera, const MotionOptions& options = {});

  // What moves in `image`; nothing in the first frame. An error of the pose of some mm and 0.3 degrees does no harm.
  // Throws InputError when the depth image is not of the camera's size.
  MoverMask segment(const RgbdImage& image, const Rigid3& cam_from_world_expected);
  // The same for those who want score() alone.
  void observe(const RgbdImage& image, const Rigid3& cam_from_world_expected);
  // Pose of the image last given; nothing when tracking is lost, upon which all views are forgotten.
  void commit(const std::optional<Rigid3>& cam_from_world);
  // After a correction of the world's frame, e.g. by a loop: later poses are given in the new one.
  void move_world(const Rigid3& new_from_old);
  void reset();
  // Per cell of the frame last segmented: from -1, surely still, to 3, surely moving; 0 = nothing known;
  // empty before the first frame and after reset().
  const Image<float>& score() const { return current_ ? current_->score : previous_ ? previous_->score : nothing_; }

 private:
  struct Stamped {
    double time = 0;
    Rigid3 cam_from_world;
  };

  Rigid3 depth_cam_from_cam(const Rigid3& cam_from_world) const;
  float tolerance_at(float depth) const;
  void carry_scores();
  void compare(MotionDepthGrid& view);
  void find_openings();
  void weigh();
  void update_scores();
  void clear_thin_holes(MoverMask& mask) const;
  void clear_lone_holes(Image<uint8_t>& marked);
  MoverMask mask();
  void keep_as_view(std::unique_ptr<MotionDepthGrid> grid);
  std::unique_ptr<MotionDepthGrid> take_spare();

  CameraModel camera_;
  MotionOptions options_;
  MotionRays rays_;
  MotionSmoothing smoothing_;
  std::unique_ptr<MotionDepthGrid> current_, previous_;
  std::vector<std::unique_ptr<MotionDepthGrid>> views_;  // oldest first
  std::vector<std::unique_ptr<MotionDepthGrid>> spare_;
  Rigid3 depth_from_colour_;     // of the image last given: cameras at the stamps of its depth and colour
  std::optional<Stamped> last_;  // colour image last committed
  double image_time_ = 0;
  size_t turn_ = 0;
  int frames_ = 0;
  MotionProjection projection_;
  const Image<float> nothing_;
  Image<float> tolerance_;                        // [m] by cell
  Image<float> intrusions_, agreements_, still_;  // votes of the views
  Image<float> missing_;                          // share of the frames without depth there
  Image<float> weighted_, weights_;
  Image<uint8_t> known_, open_;
};

}  // namespace dkb
