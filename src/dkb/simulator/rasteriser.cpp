// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/rasteriser.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/simulator/raster_kernels.h"

namespace dkb::sim {
namespace {

constexpr double kNear = 0.02;         // [m]
constexpr double kSeamOverlap = 2e-4;  // [m] patches overlap that much, so that edges shared by two show no gaps
constexpr float kMipBias = -0.75F;     // sharper than one texel per pixel, because several rays are averaged

struct PixelBox {
  int x0, y0, x1, y1;  // inclusive
  bool empty() const { return x0 > x1 || y0 > y1; }
};

// Corners of a patch in the camera, cut off at the near plane.
struct Polygon {
  std::array<Eigen::Vector3d, 5> points;
  int count = 0;
};

Polygon clip_near(const std::array<Eigen::Vector3d, 4>& corners) {
  Polygon out;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d &a = corners[i], &b = corners[(i + 1) % 4];
    if (a.z() > kNear) out.points[static_cast<size_t>(out.count++)] = a;
    if ((a.z() > kNear) != (b.z() > kNear)) {
      const double s = (kNear - a.z()) / (b.z() - a.z());
      out.points[static_cast<size_t>(out.count++)] = a + s * (b - a);
    }
  }
  return out;
}

// Bounds of the pixels that see the ellipsoid {c + e : e^T shape^-1 e <= 1} by the dual conic of its outline; the whole
// image when part of it is behind the camera.
PixelBox ellipsoid_bounds(const Eigen::Vector3d& c, const Eigen::Matrix3d& shape, const CameraModel& camera) {
  PixelBox box{0, 0, camera.width - 1, camera.height - 1};
  const double d33 = c.z() * c.z() - shape(2, 2);
  if (d33 <= 1e-6 || c.z() < 0) return c.z() < -std::sqrt(shape(2, 2)) ? PixelBox{0, 0, -1, -1} : box;
  const auto range = [&](int axis, double f, double principal, int size, int* low, int* high) {
    const double d13 = c(axis) * c.z() - shape(axis, 2), d11 = c(axis) * c(axis) - shape(axis, axis);
    const double root = std::sqrt(std::max(0.0, d13 * d13 - d11 * d33));
    const double a = f * (d13 - root) / d33 + principal, b = f * (d13 + root) / d33 + principal;
    *low = static_cast<int>(std::clamp(std::floor(a) - 1, -1.0, static_cast<double>(size)));
    *high = static_cast<int>(std::clamp(std::ceil(b) + 1, -1.0, static_cast<double>(size)));
    *low = std::max(*low, 0);
    *high = std::min(*high, size - 1);
  };
  range(0, camera.fx, camera.cx, camera.width, &box.x0, &box.x1);
  range(1, camera.fy, camera.cy, camera.height, &box.y0, &box.y1);
  return box;
}

PixelBox join(const PixelBox& a, const PixelBox& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

bool sphere_visible(const Eigen::Vector3d& c, double radius, const CameraModel& camera, double slack) {
  const double r = radius + slack + slack * c.norm();
  if (c.z() < -r) return false;
  const double left = camera.cx / camera.fx, right = (camera.width - 1 - camera.cx) / camera.fx;
  const double top = camera.cy / camera.fy, bottom = (camera.height - 1 - camera.cy) / camera.fy;
  const auto outside = [&](double along, double tangent) {
    return along - tangent * c.z() > r * std::sqrt(1 + tangent * tangent);
  };
  return !outside(-c.x(), left) && !outside(c.x(), right) && !outside(-c.y(), top) && !outside(c.y(), bottom);
}

// Rows in which a sphere may be seen.
Rows rows_of_sphere(const Eigen::Vector3d& c, double radius, const CameraModel& camera, double slack) {
  const double r = radius + slack + slack * c.norm(), distance = std::hypot(c.y(), c.z());
  if (r >= distance) return {};
  const double middle = std::atan2(c.y(), c.z()), half = std::asin(r / distance);
  constexpr double kSteepest = 1.4;  // [rad]
  Rows rows;
  if (middle - half > -kSteepest)
    rows.first = static_cast<int>(std::floor(camera.cy + camera.fy * std::tan(std::min(middle - half, kSteepest)))) - 3;
  if (middle + half < kSteepest)
    rows.end = static_cast<int>(std::ceil(camera.cy + camera.fy * std::tan(std::max(middle + half, -kSteepest)))) + 4;
  return rows;
}

}  // namespace

void DrawList::add(const Surfaces& surfaces) {
  for (const Patch& p : surfaces.patches) patches.push_back(&p);
  for (const Quadric& q : surfaces.quadrics) quadrics.push_back(&q);
  patch_rows.resize(patches.size());
  quadric_rows.resize(quadrics.size());
}

void DrawList::add_visible(const Surfaces& surfaces, const CameraModel& camera, const Rigid3& cam_from_world,
                           double slack) {
  const Eigen::Vector3d eye = centre_in_world(cam_from_world);
  for (const Patch& p : surfaces.patches) {
    const Eigen::Vector3d away = p.u.cross(p.v);
    if (away.dot(p.origin - eye) < -slack * away.norm()) continue;  // seen from behind
    const Eigen::Vector3d centre = cam_from_world * (p.origin + 0.5 * (p.u + p.v));
    const double radius = 0.5 * std::max((p.u + p.v).norm(), (p.u - p.v).norm());
    if (!sphere_visible(centre, radius, camera, slack)) continue;
    patches.push_back(&p);
    patch_rows.push_back(rows_of_sphere(centre, radius, camera, slack));
  }
  for (const Quadric& q : surfaces.quadrics) {
    const Eigen::Matrix3d from_local = q.to_local.inverse();
    const Eigen::Vector3d middle = q.tube ? Eigen::Vector3d(q.centre + 0.5 * from_local.col(2)) : q.centre;
    const double radius = from_local.norm() * (q.tube ? std::max(1.0, 1.0 + q.taper) : 1.0);
    const Eigen::Vector3d centre = cam_from_world * middle;
    if (!sphere_visible(centre, radius, camera, slack)) continue;
    quadrics.push_back(&q);
    quadric_rows.push_back(rows_of_sphere(centre, radius, camera, slack));
  }
}

void Rasteriser::draw_patch(const Patch& patch, int id, const Rigid3& cam_from_world, const Eigen::Matrix3d& r,
                            GeometryImage* out) {
  PatchView& view = patch_views_[static_cast<size_t>(id)];
  const Eigen::Vector3d o = cam_from_world * patch.origin, u = r * patch.u, v = r * patch.v;
  const Eigen::Vector3d away = u.cross(v);
  const double volume = away.dot(o);
  if (volume <= 1e-6 * away.norm()) return;  // seen from behind or edge-on
  const Polygon polygon = clip_near({o, o + u, o + u + v, o + v});
  if (polygon.count < 3) return;
  std::array<Eigen::Vector2d, 5> corners;
  double y_min = 1e9, y_max = -1e9, x_min = 1e9, x_max = -1e9;
  const auto n = static_cast<size_t>(polygon.count);
  for (size_t i = 0; i < n; ++i) {
    corners[i] = camera_.project(polygon.points[i]) - offset_;
    y_min = std::min(y_min, corners[i].y());
    y_max = std::max(y_max, corners[i].y());
    x_min = std::min(x_min, corners[i].x());
    x_max = std::max(x_max, corners[i].x());
  }
  if (x_max < -1 || y_max < rows_.first - 1 || x_min > camera_.width || y_min > rows_.end) return;

  // z (ray) = o + a u + b v, so (a, b, 1) / z = [u v o]^-1 ray: affine in the pixel, no division in the loop.
  Eigen::Matrix3d basis;
  basis << u, v, o;
  Eigen::Matrix3d h = basis.inverse();
  Eigen::Matrix3d ray_from_pixel;
  ray_from_pixel << 1 / camera_.fx, 0, (offset_.x() - camera_.cx) / camera_.fx, 0, 1 / camera_.fy,
      (offset_.y() - camera_.cy) / camera_.fy, 0, 0, 1;
  h = (h * ray_from_pixel).eval();
  for (int i = 0; i < 9; ++i) view.h[i] = h(i / 3, i % 3);
  view.density = std::abs(h.determinant());
  view.normal = (-away.normalized()).cast<float>();

  const auto slack_u = static_cast<float>(kSeamOverlap / u.norm()),
             slack_v = static_cast<float>(kSeamOverlap / v.norm());
  const float u_low = -slack_u, u_high = 1 + slack_u, v_low = -slack_v, v_high = 1 + slack_v;
  const int row0 = static_cast<int>(std::clamp<double>(std::floor(y_min), rows_.first, rows_.end));
  const int row1 = static_cast<int>(std::clamp<double>(std::ceil(y_max), rows_.first - 1, rows_.end - 1));
  for (int y = row0; y <= row1; ++y) {
    // The span of this row, generously: what the edges touch within one pixel above and below.
    double left = 1e9, right = -1e9;
    for (size_t i = 0; i < n; ++i) {
      Eigen::Vector2d a = corners[i], b = corners[(i + 1) % n];
      if (a.y() > b.y()) std::swap(a, b);
      const double low = std::max(a.y(), y - 1.0), high = std::min(b.y(), y + 1.0);
      if (low > high) continue;
      const double slope = b.y() - a.y() > 1e-9 ? (b.x() - a.x()) / (b.y() - a.y()) : 0;
      if (slope == 0 && b.y() - a.y() <= 1e-9) {
        left = std::min({left, a.x(), b.x()});
        right = std::max({right, a.x(), b.x()});
        continue;
      }
      const double xa = a.x() + slope * (low - a.y()), xb = a.x() + slope * (high - a.y());
      left = std::min({left, xa, xb});
      right = std::max({right, xa, xb});
    }
    if (left > right) continue;
    const int x0 = static_cast<int>(std::clamp(std::floor(left) - 1, 0.0, static_cast<double>(camera_.width)));
    const int x1 = static_cast<int>(std::clamp(std::ceil(right) + 1, -1.0, static_cast<double>(camera_.width - 1)));
    const int count = x1 - x0 + 1;
    if (count <= 0) continue;
    const auto at = [&](int i) {
      return static_cast<float>(view.h[3 * i] * x0 + view.h[3 * i + 1] * y + view.h[3 * i + 2]);
    };
    const float a0 = at(0), b0 = at(1), c0 = at(2);
    const auto a1 = static_cast<float>(view.h[0]), b1 = static_cast<float>(view.h[3]),
               c1 = static_cast<float>(view.h[6]);
    float* depth = out->inverse_depth.row(y) + x0;
    int32_t* ids = out->id.row(y) + x0;
    if (patch.disc) {
      for (int i = 0; i < count; ++i) {
        const auto t = static_cast<float>(i);
        const float inverse = c0 + c1 * t, a = a0 + a1 * t - 0.5F * inverse, b = b0 + b1 * t - 0.5F * inverse;
        const bool in = (a * a + b * b <= 0.25F * inverse * inverse) & (inverse > depth[i]);
        depth[i] = in ? inverse : depth[i];
        ids[i] = in ? id : ids[i];
      }
    } else {
      draw_patch_span({a0, a1, b0, b1, c0, c1, u_low, u_high, v_low, v_high, id}, count, depth, ids, simd_);
    }
  }
}

void Rasteriser::draw_quadric(const Quadric& quadric, int id, const Rigid3& cam_from_world,
                              const Eigen::Matrix3d& world_from_cam, GeometryImage* out) {
  QuadricView& view = quadric_views_[static_cast<size_t>(id) - patch_views_.size()];
  view.m = quadric.to_local * world_from_cam;
  view.centre = cam_from_world * quadric.centre;
  view.world_from_cam = quadric.to_local.inverse() * view.m;
  const Eigen::Matrix3d from_local = view.m.inverse();
  CameraModel shifted = camera_;
  shifted.cx -= offset_.x();
  shifted.cy -= offset_.y();
  PixelBox box;
  if (quadric.tube) {
    // Both end discs; the tube is their convex hull.
    const Eigen::Matrix3d disc = from_local.leftCols<2>() * from_local.leftCols<2>().transpose();
    const double end = quadric.radius + quadric.taper;
    box = join(ellipsoid_bounds(view.centre, disc * quadric.radius * quadric.radius, shifted),
               ellipsoid_bounds(view.centre + from_local.col(2), disc * end * end, shifted));
  } else {
    box = ellipsoid_bounds(view.centre, from_local * from_local.transpose(), shifted);
  }
  box.y0 = std::max(box.y0, rows_.first);
  box.y1 = std::min(box.y1, rows_.end - 1);
  if (box.empty()) return;

  // Along a ray, l(z) = m (ray z - centre). Measured from the plane z = pivot, near the surface, the numbers stay small
  // enough for floats.
  const double pivot = std::max(0.1, view.centre.z());
  QuadricSpan span{};
  span.pivot = static_cast<float>(pivot);
  span.sign = quadric.tube ? -1.0F : 1.0F;
  span.tau = quadric.tube ? 0.0F : 1.0F;
  span.taper = static_cast<float>(quadric.tube ? quadric.taper : 1.0);
  span.bias = static_cast<float>(quadric.tube ? quadric.radius : 0.0);
  span.low = quadric.tube ? 0.0F : -2.0F;
  span.high = quadric.tube ? 1.0F : 2.0F;
  span.id = id;
  const Eigen::Vector3f step = (view.m.col(0) / camera_.fx).cast<float>();
  for (int i = 0; i < 3; ++i) {
    span.d_step[i] = step(i);
    span.m_step[i] = step(i) * span.pivot;
  }
  for (int y = box.y0; y <= box.y1; ++y) {
    const Eigen::Vector3d first = view.m * ray(box.x0, y);
    const Eigen::Vector3f d0 = first.cast<float>(), m0 = (first * pivot - view.m * view.centre).cast<float>();
    for (int i = 0; i < 3; ++i) {
      span.d[i] = d0(i);
      span.m[i] = m0(i);
    }
    draw_quadric_span(span, box.x1 - box.x0 + 1, out->inverse_depth.row(y) + box.x0, out->id.row(y) + box.x0, simd_);
  }
}

void Rasteriser::draw(const DrawList& list, const Rigid3& cam_from_world, const Eigen::Vector2d& offset, Rows rows,
                      GeometryImage* out) {
  if (out->id.width() != camera_.width || out->id.height() != camera_.height) {
    out->id = Image<int32_t>(camera_.width, camera_.height);
    out->inverse_depth = Image<float>(camera_.width, camera_.height);
  }
  std::fill(out->id.row(rows.first), out->id.row(rows.end), -1);
  std::fill(out->inverse_depth.row(rows.first), out->inverse_depth.row(rows.end), 0.0F);
  offset_ = offset;
  rows_ = rows;
  patch_views_.resize(list.patches.size());
  quadric_views_.resize(list.quadrics.size());
  const Eigen::Matrix3d r = cam_from_world.matrix3(), r_inverse = r.transpose();
  int id = 0;
  for (size_t i = 0; i < list.patches.size(); ++i, ++id)
    if (list.patch_rows[i].meets(rows)) draw_patch(*list.patches[i], id, cam_from_world, r, out);
  for (size_t i = 0; i < list.quadrics.size(); ++i, ++id)
    if (list.quadric_rows[i].meets(rows)) draw_quadric(*list.quadrics[i], id, cam_from_world, r_inverse, out);
}

[[gnu::always_inline]] inline Rasteriser::Hit Rasteriser::hit(const Quadric& quadric, const QuadricView& view, int x,
                                                              int y, float inverse_depth) const {
  Hit h;
  h.local = (view.m * (ray(x, y) / static_cast<double>(inverse_depth) - view.centre)).cast<float>();
  Eigen::Vector3f n = h.local;
  if (quadric.tube)
    n.z() = -static_cast<float>(quadric.taper * (quadric.radius + quadric.taper * static_cast<double>(h.local.z())));
  h.normal = (view.m.transpose() * n.cast<double>()).normalized().cast<float>();
  return h;
}

void Rasteriser::add_colour(const DrawList& list, const Materials& materials, const GeometryImage& geometry,
                            float level_shift, std::vector<uint64_t>* sum) const {
  const auto n_patches = static_cast<int32_t>(list.patches.size());
  for (int y = rows_.first; y < rows_.end; ++y) {
    const int32_t* ids = geometry.id.row(y);
    const float* depth = geometry.inverse_depth.row(y);
    uint64_t* target = sum->data() + static_cast<size_t>(y) * static_cast<size_t>(camera_.width);
    for (int x = 0; x < camera_.width;) {
      const int32_t id = ids[x];
      int end = x + 1;
      while (end < camera_.width && ids[end] == id) ++end;
      if (id >= 0 && id < n_patches) {
        const Patch& patch = *list.patches[static_cast<size_t>(id)];
        const PatchView& view = patch_views_[static_cast<size_t>(id)];
        const Texture& texture = materials.texture(patch.look.texture);
        const auto at = [&](int i) {
          return static_cast<float>(view.h[3 * i] * x + view.h[3 * i + 1] * y + view.h[3 * i + 2]);
        };
        const float a0 = at(0), b0 = at(1), c0 = at(2);
        const auto a1 = static_cast<float>(view.h[0]), b1 = static_cast<float>(view.h[3]),
                   c1 = static_cast<float>(view.h[6]);
        const auto texels =
            static_cast<float>(view.density * texture.width() * static_cast<double>(std::abs(patch.look.du)) *
                               texture.height() * static_cast<double>(std::abs(patch.look.dv)));
        add_texture_span({a0, a1, b0, b1, c0, c1, patch.look.u0, patch.look.du, patch.look.v0, patch.look.dv, texels,
                          kMipBias, level_shift, patch.shade},
                         texture, end - x, target + x, simd_);
      } else if (id >= n_patches) {
        const Quadric& quadric = *list.quadrics[static_cast<size_t>(id - n_patches)];
        const QuadricView& view = quadric_views_[static_cast<size_t>(id - n_patches)];
        const Texture& texture = materials.texture(quadric.look.texture);
        const double girth = 6.2832 / quadric.to_local.row(0).norm();
        const double lod = std::log2(texture.width() * static_cast<double>(quadric.look.du) /
                                         (girth * camera_.fx * static_cast<double>(depth[x])) +
                                     1e-6);
        const int level = std::clamp(static_cast<int>(std::floor(static_cast<float>(lod) + kMipBias + level_shift)), 0,
                                     texture.levels() - 1);
        for (int i = x; i < end; ++i) {
          const auto [local, normal] = hit(quadric, view, i, y, depth[i]);
          const float shade = lambert_shade(view.world_from_cam * normal.cast<double>());
          const float u = 0.5F + std::atan2(local.y(), local.x()) * 0.15915494F;
          const float v = quadric.tube ? 1.0F - local.z() : 0.5F - 0.5F * local.z();
          target[i] += (shaded(texture.sample(quadric.look.u0 + quadric.look.du * u,
                                              quadric.look.v0 + quadric.look.dv * v, level),
                               shade) >>
                        3) &
                       0x1FFF1FFF1FFF1FFFULL;
        }
      }
      x = end;
    }
  }
}

void Rasteriser::reflectance(const DrawList& list, const Materials& materials, const GeometryImage& geometry,
                             Image<float>* grey, Image<float>* cosine) const {
  if (grey->width() != camera_.width || grey->height() != camera_.height) {
    *grey = Image<float>(camera_.width, camera_.height);
    *cosine = Image<float>(camera_.width, camera_.height);
  }
  const auto n_patches = static_cast<int32_t>(list.patches.size());
  for (int y = rows_.first; y < rows_.end; ++y)
    for (int x = 0; x < camera_.width; ++x) {
      const int32_t id = geometry.id(x, y);
      float value = 0, cos = 0;
      if (id >= 0) {
        uint64_t colour;
        Eigen::Vector3f normal;
        const Eigen::Vector3f direction = ray(x, y).normalized().cast<float>();
        const float inverse = geometry.inverse_depth(x, y);
        if (id < n_patches) {
          const Patch& patch = *list.patches[static_cast<size_t>(id)];
          const PatchView& view = patch_views_[static_cast<size_t>(id)];
          const auto a = static_cast<float>(view.h[0] * x + view.h[1] * y + view.h[2]) / inverse;
          const auto b = static_cast<float>(view.h[3] * x + view.h[4] * y + view.h[5]) / inverse;
          const Texture& texture = materials.texture(patch.look.texture);
          colour = shaded(texture.sample(patch.look.u0 + patch.look.du * a, patch.look.v0 + patch.look.dv * b,
                                         std::min(2, texture.levels() - 1)),
                          patch.shade);
          normal = view.normal;
        } else {
          const Quadric& quadric = *list.quadrics[static_cast<size_t>(id - n_patches)];
          const Hit h = hit(quadric, quadric_views_[static_cast<size_t>(id - n_patches)], x, y, inverse);
          const Eigen::Vector3f& local = h.local;
          normal = h.normal;
          const Texture& texture = materials.texture(quadric.look.texture);
          const float u = 0.5F + std::atan2(local.y(), local.x()) * 0.15915494F;
          const float v = quadric.tube ? 1.0F - local.z() : 0.5F - 0.5F * local.z();
          colour = shaded(texture.sample(quadric.look.u0 + quadric.look.du * u, quadric.look.v0 + quadric.look.dv * v,
                                         std::min(2, texture.levels() - 1)),
                          0.9F);
        }
        const auto channel = [&](int lane) {
          return static_cast<float>((colour >> (16 * lane)) & 0xFFFF) * (1.0F / 256.0F);
        };
        value = 0.299F * channel(0) + 0.587F * channel(2) + 0.114F * channel(1);
        cos = std::abs(normal.dot(direction));
      }
      (*grey)(x, y) = value;
      (*cosine)(x, y) = cos;
    }
}

}  // namespace dkb::sim
