// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/image.h"

namespace dkb {

// A flat surface as a depth image shows it: the points p [m, in the camera] with over_distance . p = 1. That is the
// normal, which looks away from the camera, over the plane's distance.
struct PlanePatch {
  Eigen::Vector3d over_distance = Eigen::Vector3d::Zero();  // [1/m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();     // [1/m^2] of it, by the sensor's noise alone
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();         // [m] on the plane, in the middle of what is seen of it

  Eigen::Vector3d normal() const { return over_distance.normalized(); }
  double distance() const { return 1 / over_distance.norm(); }  // [m]
};

// The flat surfaces of a depth image, and which blocks of pixels show them.
struct PlaneView {
  static constexpr int kBlock = 16;  // [px] side of a block

  std::vector<PlanePatch> patches;
  Image<uint8_t> patch_at;  // per block of the image as read: number of its patch, from 1; 0 = none
};

// Finds the flat surfaces of depth images. On a plane inverse depth is an affine function of the viewing ray, and a
// structured-light sensor's noise in it is about the same at every distance: blocks of pixels where that holds are
// fitted by least squares and grown together while one plane explains them. Deterministic.
class PlaneFinder {
 public:
  PlaneFinder(const CameraModel& camera, const SensorNoise& noise);

  // In the axes of a camera that `cam_from_depth_cam` leads to. Blocks that `movers` marks the middle of are left out.
  PlaneView find(const DepthImage& depth, const MoverMask& movers, const Rigid3& cam_from_depth_cam = {});

 private:
  // Weighted sums over depths: of r r^T, of r w and of w^2, with r = [x y 1] the ray and w the inverse depth.
  struct Moments {
    Eigen::Matrix3d rays = Eigen::Matrix3d::Zero();
    Eigen::Vector3d products = Eigen::Vector3d::Zero();
    double squares = 0;
    int depths = 0;

    void add(const Moments& other);
    // Sum of the squared distances of the inverse depths from a plane's, in standard deviations.
    double misfit(const Eigen::Vector3d& over_distance) const;
    // Of the weighted distances themselves.
    double offset(const Eigen::Vector3d& over_distance) const { return products.z() - over_distance.dot(rays.col(2)); }
    double weight() const { return rays(2, 2); }
  };
  struct Block {
    Moments moments;
    Eigen::Vector3d over_distance = Eigen::Vector3d::Zero();
    double misfit = 0;  // per degree of freedom
    bool flat = false, taken = false;
  };
  struct Region {
    std::vector<int> blocks;
    Moments moments;
    Eigen::Vector3d over_distance = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };
  Block measure(const DepthImage& depth, int x, int y) const;
  Region grow(int seed);
  PlanePatch patch_of(const Region& region) const;

  SensorNoise noise_;
  int width_, height_;        // [blocks]
  std::vector<float> x_, y_;  // rays at depth 1 of the depths that are looked at, block by block
  std::vector<Block> blocks_;
};

}  // namespace dkb
