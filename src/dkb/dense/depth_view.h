// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "dkb/dense/dense_options.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/map/ids.h"

namespace dkb {

// What the dense map keeps of a keyframe: still depth on a coarser grid of ideal (undistorted) pixels.
struct DepthView {
  static constexpr float kUnitsPerMetre = 4000;

  FrameIndex frame = 0;
  double depth_time = 0;  // [s]
  Image<uint16_t> depth;  // [1 / kUnitsPerMetre m] along the optical axis; 0 = none, unsure, or a mover
  ColourImage colour;     // same size

  float metres(int x, int y) const { return static_cast<float>(depth(x, y)) * (1.0F / kUnitsPerMetre); }
};

// Pinhole camera of the views: pixel = f * point.xy / point.z + c.
struct ViewCamera {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Eigen::Vector3d ray(int x, int y) const { return {(x - cx) / fx, (y - cy) / fy, 1}; }
};

// How directly a view looks at its surfaces: |normal . ray| per pixel, for rays with unit depth and unit normals from
// the depths 3 pixels around. So (measured - z) times this is the distance of a point at depth z from the surface's
// tangent plane. 0 where the normal is not known.
Image<float> facing(const DepthView& view, const ViewCamera& camera);

// Makes views from images. Deterministic.
class DepthViewMaker {
 public:
  DepthViewMaker(const CameraModel& camera, const DenseOptions& options);

  const ViewCamera& camera() const { return view_camera_; }
  // Depths at jumps and on movers, and those around them, are left out.
  DepthView make(FrameIndex frame, const RgbdImage& image, double depth_time, const MoverMask& movers) const;
  // Movers that became known later.
  void remove(const MoverMask& movers, DepthView* view) const;

 private:
  CameraModel camera_;
  DenseOptions options_;
  ViewCamera view_camera_;
  std::vector<int32_t> source_;  // image pixel (index) of each view pixel; -1 = outside
};

}  // namespace dkb
