// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

struct MoverObserverOptions {
  int cell = 4;         // [px] one depth is looked at per square of this size, 1 ... 32
  int min_cells = 12;   // cells with depth that a boxed object needs, >= 1
  int min_region = 40;  // the same for a region without a box, >= 1
  double margin = 0.1;  // share of a box's size by which its rim reaches; mask in the rim is no object of its own, >= 0
  double layer = 0.45;  // [m] an object reaches so far before and behind its main depth layer, > 0
  double depth_jump = 0.05;  // [1] depth jump between neighbouring cells of one region, relative to depth, > 0
  double inner_share = 0.4;  // of a region's cells must have all four neighbours in it: others are rims, (0, 1]
  int gap = 4;  // [cells] regions so near to each other in the image and `merge_depth` in depth are one, >= 0
  double merge_depth = 0.25;  // [m] > 0
  void check() const;         // throws InvalidOption
};

// One object of one frame.
struct MoverObservation {
  std::string class_name;             // of its box; empty: no box, found by its motion alone
  Box box;                            // [px] the detector's, or the region's bounds
  Eigen::Vector3d position_in_world;  // [m] median of its visible surface points, per coordinate
  double position_sd = 0;             // [m] standard deviation of each coordinate
};

// Tells the objects of one image apart and measures where their surfaces are: those in boxes, each with the part of the
// mask that is at its depth, and regions of the mask outside all boxes, split by depth. Deterministic.
class MoverObserver {
 public:
  MoverObserver(const CameraModel& camera, const MoverObserverOptions& options);  // throws InvalidOption

  // `depth` has the camera's size (else InputError); `boxes` are in pixels of the same image. Objects in boxes come
  // first, in the order of the boxes; those of too few cells with depth are left out.
  std::vector<MoverObservation> observe(const DepthImage& depth, const MoverMask& mask,
                                        std::span<const Detection> boxes, const Rigid3& world_from_cam);

 private:
  struct CellRange {
    int x0, y0, x1, y1;  // half open
  };
  struct Region {
    CellRange bounds;
    std::vector<size_t> cells;
  };
  CellRange cells_in(const Box& box, double margin) const;
  template <class Function>
  void for_each_cell(const CellRange& range, const Function& function) const;
  float depth_near(const DepthImage& depth, int x, int y) const;
  Eigen::Vector3d median_position(std::span<const size_t> cells) const;
  void take_masked_depth(const DepthImage& depth, const MoverMask& mask);
  float main_layer(const std::vector<float>& depths) const;
  std::vector<float> box_depths(std::span<const Detection> boxes, const std::vector<CellRange>& ranges) const;
  std::vector<MoverObservation> observe_boxes(std::span<const Detection> boxes) const;
  std::vector<Region> find_regions(const std::vector<char>& claimed) const;

  CameraModel camera_;
  MoverObserverOptions options_;
  int columns_ = 0, rows_ = 0;
  std::vector<Eigen::Vector2f> rays_;  // per cell: x/z, y/z of its middle

  // Of the frame looked at.
  Rigid3 world_from_cam_;
  std::vector<float> depth_;  // [m] per cell; 0 = not in the mask, or no depth
};

}  // namespace dkb
