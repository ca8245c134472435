// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/image.h"
#include "dkb/simulator/materials.h"
#include "dkb/simulator/surfaces.h"

namespace dkb::sim {

// Rows first ... end - 1 of an image.
struct Rows {
  int first = 0, end = 1 << 30;
  bool meets(const Rows& other) const { return first < other.end && other.first < end; }
};

// What one view draws: pointers into surfaces that outlive it. A primitive's id is its index, patches first.
struct DrawList {
  std::vector<const Patch*> patches;
  std::vector<const Quadric*> quadrics;
  std::vector<Rows> patch_rows, quadric_rows;  // where each may be seen; as many as there are primitives

  void add(const Surfaces& surfaces);
  // Only what may be seen from a pose within `slack` [m, and rad] of the given one.
  void add_visible(const Surfaces& surfaces, const CameraModel& camera, const Rigid3& cam_from_world, double slack);
};

// Nearest surface per pixel.
struct GeometryImage {
  Image<float> inverse_depth;  // [1/m] along the optical axis, 0 = nothing
  Image<int32_t> id;           // -1 = nothing
};

// Draws one view of a draw list with an ideal pinhole camera: exact ray intersections at one point per pixel,
// z-buffered in inverse depth. Not thread-safe; one per thread.
class Rasteriser {
 public:
  explicit Rasteriser(const CameraModel& camera, Simd simd = best_simd()) : camera_(camera), simd_(simd) {}

  // Draws some rows. Rays go through pixel centre + `offset` [px]. `out` is resized if need be, and
  // its other rows are kept. The functions below are for the rows of the last draw().
  using Rows = sim::Rows;
  void draw(const DrawList& list, const Rigid3& cam_from_world, const Eigen::Vector2d& offset, Rows rows,
            GeometryImage* out);

  // Adds the texture colour of each pixel to `sum` (lanes r, b, g, 0 of 16 bits), 1/8 of 8.5 fixed point: eight calls
  // fill the lanes. `level_shift` in [0, 1) chooses between the two nearest mip levels: spread over the calls it blends
  // them.
  void add_colour(const DrawList& list, const Materials& materials, const GeometryImage& geometry, float level_shift,
                  std::vector<uint64_t>* sum) const;

  // Grey level (0 ... 255) without filtering in a neighbourhood, and the cosine between surface normal and ray.
  void reflectance(const DrawList& list, const Materials& materials, const GeometryImage& geometry, Image<float>* grey,
                   Image<float>* cosine) const;

 private:
  struct PatchView {
    double h[9];             // pixel (x, y, 1) -> (u, v, 1) / z
    double density;          // |Jacobian determinant| of pixel -> texel, times z^-3
    Eigen::Vector3f normal;  // in camera
  };
  struct QuadricView {
    Eigen::Matrix3d m;       // to_local * world_from_cam rotation
    Eigen::Vector3d centre;  // in camera
    Eigen::Matrix3d world_from_cam;
  };
  void draw_patch(const Patch& patch, int id, const Rigid3& cam_from_world, const Eigen::Matrix3d& cam_from_world_r,
                  GeometryImage* out);
  void draw_quadric(const Quadric& quadric, int id, const Rigid3& cam_from_world, const Eigen::Matrix3d& world_from_cam,
                    GeometryImage* out);
  struct Hit {
    Eigen::Vector3f local, normal;  // point in the quadric's coordinates; unit normal in the camera
  };
  Hit hit(const Quadric& quadric, const QuadricView& view, int x, int y, float inverse_depth) const;
  Eigen::Vector3d ray(double x, double y) const {
    return {(x + offset_.x() - camera_.cx) / camera_.fx, (y + offset_.y() - camera_.cy) / camera_.fy, 1};
  }

  const CameraModel camera_;
  const Simd simd_;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();
  Rows rows_;
  std::vector<PatchView> patch_views_;
  std::vector<QuadricView> quadric_views_;
};

}  // namespace dkb::sim
