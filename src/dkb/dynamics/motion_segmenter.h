// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dkb/dynamics/depth_alignment.h"
#include "dkb/dynamics/match_motion.h"
#include "dkb/dynamics/motion_depth_grid.h"
#include "dkb/dynamics/motion_smoothing.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/dynamics/silhouette.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

struct MotionOptions {
  double memory = 6;       // [s] time constant in which a mover that stands still is forgotten, > 0
  double threshold = 0.5;  // score from which a cell moves; one frame adds at most 1, (0, 2]
};

// Finds what moves against the camera's own motion, of any class, without a model: surfaces in space that an earlier
// view saw empty, with what they hang together with (docs/method.md). Who stops moving stays marked for seconds.
//
// Works on depth alone, on a coarse grid. Deterministic. Keeps its buffers from frame to frame; one object per thread.
// Calls alternate: observe() with the expected pose, then commit() with the one that tracking found.
class MotionSegmenter {
 public:
  MotionSegmenter(const CameraModel& camera, const SensorNoise& noise, const MotionOptions& options = {},
                  Simd simd = best_simd());

  // `depth_time` [s]: when the colour camera saw what the depth image shows.
  // An image without any depth tells nothing: what moved in the one before it, not long ago, is where it would be seen
  // now. An error of the pose of some mm and 0.3 degrees does no harm. `step_covariance`: how far the motion since the
  // frame before may be from what is expected (as MotionPrior's). Throws InputError when the depth image is not of the
  // camera's size.
  void observe(const RgbdImage& image, double depth_time, const Rigid3& cam_from_world_expected,
               const Matrix6d& step_covariance);
  // What moves in the image last given; nothing in the first frame.
  MoverMask mask();
  // What is known to stand still in the image last given.
  StillCells still() const;
  // Bodies that a detector found in it: they carry a score from which no view of them testifies later that they are
  // part of the room, though they stand.
  void take_bodies(const MoverMask& bodies);
  // Matches of the image last given showed two motions: who walks off moves, as far as a frame can say it. Until then
  // the map held him for the room, and depth followed him as corners did.
  void take_second_motion(std::span<const MatchMotion> matches);
  // The colour camera's motion since the frame committed last as depth shows it beside what was expected, of the image
  // last given; nothing when there was no view to hold it against.
  const std::optional<MotionPrior>& aligned_step() const { return aligned_step_; }
  // Pose of the image last given; nothing when tracking is lost, upon which all views are forgotten. While poses are
  // guesses, which drift, the views from before them say nothing: they would take the whole room for moved.
  void commit(const std::optional<Rigid3>& cam_from_world, bool guessed = false);
  // After a correction of the world's frame, e.g. by a loop: later poses are given in the new one.
  void move_world(const Rigid3& new_from_old) { move_views(new_from_old, -std::numeric_limits<double>::infinity()); }
  // What the poses committed as guesses were off by, those since the last one that images told.
  void correct_guesses(const Rigid3& found_from_guessed) { move_views(found_from_guessed, told_); }
  // Of all images but the one last given.
  void forget_views();
  void reset();
  // Per cell of the frame last segmented: from -1, surely still, to 3, surely moving; 0 = nothing known;
  // empty before the first frame and after reset().
  const Image<float>& score() const { return current_ ? current_->score : previous_ ? previous_->score : nothing_; }

 private:
  struct Stamped {
    double time = 0;
    Rigid3 cam_from_world;
  };

  struct ChosenView {  // that the image last given is compared with
    const MotionView* view;
    Rigid3 there_from_here;
    float trust;
  };

  void move_views(const Rigid3& new_from_old, double after);
  Rigid3 depth_cam_from_cam(const Rigid3& step, double seconds) const;
  Rigid3 depth_cam_from_cam(const Rigid3& cam_from_world) const;
  void find_velocity();
  ReadoutMotion readout_of(const Vector6d& velocity) const { return {velocity, alignment_.readout()}; }
  void find_pose(const Matrix6d& step_covariance);
  bool is_placed(const Matrix6d& step_covariance) const;
  void choose_views();
  void find_tolerances(CellRange block);
  void carry_scores(CellRange block);
  void compare(const ChosenView& view, CellRange block);
  void find_vacated();
  void weigh();
  void update_scores();
  void keep_as_view(const MotionDepthGrid& grid);

  CameraModel camera_;
  SensorNoise noise_;
  MotionOptions options_;
  Simd simd_;
  MotionRays rays_;
  MotionSmoothing smoothing_;
  DepthAlignment alignment_;
  std::unique_ptr<MotionDepthGrid> current_, previous_;
  std::vector<std::unique_ptr<MotionView>> views_;  // oldest first
  std::unique_ptr<MotionDepthGrid> spare_;          // for their buffers
  std::unique_ptr<MotionView> spare_view_;
  Rigid3 depth_from_colour_;     // of the image last given: cameras at the stamps of its depth and colour
  std::optional<Stamped> last_;  // colour image last committed
  double image_time_ = 0;
  bool has_depth_ = true;  // the image last given
  double told_ = 0;        // [s] depth stamp of the last image committed with a pose that images told
  bool guessing_ = false;  // the pose committed last was a guess
  std::optional<MotionPrior> aligned_step_;
  size_t turn_ = 0;
  MotionProjection projection_;
  const Image<float> nothing_;
  Image<float> still_;  // votes of the views that had the surface where it is
  Image<float> weighted_, weights_;
  Image<uint8_t> known_;
  Image<uint8_t> intruding_;  // 1 where a measured surface stands in space seen empty, or went on from where it was
  Image<uint8_t> vacated_;    // of the frame before: 1 where its surface is no more
  std::vector<ChosenView> chosen_;
  // Of the block at work: within what surfaces are the same [m], which cells have moved on, and what a view has where
  // they are.
  std::vector<float> tolerance_;
  std::vector<uint8_t> verdict_;
  struct {
    std::vector<float> nearest, farthest, depth, score;
  } there_;
};

}  // namespace dkb
