// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/dynamics/depth_parts.h"
#include "dkb/dynamics/motion_depth_grid.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/dynamics/mover_surface.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

// A mover that is followed: where it should be seen.
struct ExpectedMover {
  Eigen::Vector3d position_in_world;  // [m]
  Eigen::Matrix3d covariance;         // [m^2] of the position
};

// One object of one frame.
struct MoverObservation {
  std::string class_name;             // of its box; empty: no box, found by its motion alone
  Box box;                            // [px] the detector's, or the region's bounds
  Eigen::Vector3d position_in_world;  // [m] median of its visible surface points, per coordinate
  bool has_depth = true;              // else the position is where the middle of its box would be, 1 m deep
  double position_sd = 0;             // [m] standard deviation of each coordinate
  Eigen::Vector3d size{0, 0, 0};      // [m] of its visible surface along the camera's axes: width, height, depth
  MoverSurface surface;               // empty without depth
  int expected = -1;                  // index of the expected mover that this region is of; -1 = of none, or in a box
};

// Tells the objects of one image apart and measures where their surfaces are: those in boxes, each with the part of the
// mask that is at its depth, and regions of the mask outside all boxes, split by depth. What is where movers are
// expected goes to these, so that neighbours are not one region, and a body cut up by missing depth is. Deterministic.
class MoverObserver {
 public:
  explicit MoverObserver(const CameraModel& camera);

  // `depth` has the camera's size (else InputError); `boxes` are in pixels of the same image. Objects in boxes come
  // first, in the order of the boxes; regions of too few cells with depth are left out. A box of an unnamed region that
  // lies mostly in boxes with a name is no object of its own.
  std::vector<MoverObservation> observe(const DepthImage& depth, const MoverMask& mask,
                                        std::span<const Detection> boxes, const Rigid3& world_from_cam,
                                        std::span<const ExpectedMover> expected = {});

 private:
  struct Region {
    CellBounds bounds;
    std::vector<uint32_t> cells;
    int expected = -1;
  };
  // Where a mover's surface is looked for, seen from above: along the image's rows and the optical axis.
  struct Footprint {
    Eigen::Vector2f middle;       // [m]
    Eigen::Matrix2f information;  // [1 / m^2]
    float width;                  // logarithm of the determinant of its inverse
  };
  CellBounds cells_in(const Box& box, double margin) const;
  template <class Function>
  void for_each_cell(const CellBounds& range, const Function& function) const;
  float depth_near(const DepthImage& depth, int x, int y) const;
  std::array<std::vector<float>, 3> sample(std::span<const uint32_t> cells) const;
  MoverObservation measure(std::span<const uint32_t> cells) const;
  MoverSurface surface_of(std::span<const uint32_t> cells) const;
  bool is_masked(const MoverMask& mask, int x, int y) const;
  void take_masked_depth(const DepthImage& depth, const MoverMask& mask);
  std::vector<Detection> named_once(std::span<const Detection> boxes, const MoverMask& mask) const;
  float main_layer(const std::vector<float>& depths) const;
  std::vector<float> box_depths(std::span<const Detection> boxes, const std::vector<CellBounds>& ranges) const;
  std::vector<MoverObservation> observe_boxes(std::span<const Detection> boxes) const;
  std::vector<Region> find_regions(std::span<const Detection> boxes);
  std::vector<Footprint> footprints(std::span<const ExpectedMover> expected) const;
  std::vector<uint16_t> owners_of(std::span<const uint32_t> cells) const;
  std::vector<Region> divide(Region part) const;
  std::vector<Region> join(std::vector<Region> parts) const;

  CameraModel camera_;
  MotionRays rays_;
  DepthParts parts_;

  // Of the frame looked at.
  Rigid3 world_from_cam_;
  std::vector<float> depth_;       // [m] per cell; 0 = not in the mask, or no depth
  std::vector<float> free_depth_;  // the same without what is in a box or at its rim
  std::vector<Footprint> footprints_;
};

}  // namespace dkb
