// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/depth_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

constexpr double kEdgeShare = 0.05;  // depths beside a step of this share are left out

// Whether the 3 x 3 pixels around (x, y) are on one surface with it. Pixels without depth say nothing.
bool on_one_surface(const DepthImage& depth, int x, int y) {
  const float z = depth(x, y), step = static_cast<float>(kEdgeShare) * z;
  for (int v = std::max(0, y - 1); v <= std::min(depth.height() - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(depth.width() - 1, x + 1); ++u)
      if (depth(u, v) > 0 && std::abs(depth(u, v) - z) > step) return false;
  return true;
}

}  // namespace

Image<float> facing(const DepthView& view, const ViewCamera& camera) {
  constexpr int kOffset = 3;  // [px] of the view
  Image<float> result(view.depth.width(), view.depth.height());
  const auto point = [&](int x, int y) {
    return (static_cast<double>(view.metres(x, y)) * camera.ray(x, y)).cast<float>().eval();
  };
  for (int y = 0; y < result.height(); ++y)
    for (int x = 0; x < result.width(); ++x) {
      if (view.depth(x, y) == 0) continue;
      // From the left to the right and from above to below, or as much of it as there is.
      const int left = x >= kOffset && view.depth(x - kOffset, y) > 0 ? x - kOffset : x;
      const int right = x + kOffset < result.width() && view.depth(x + kOffset, y) > 0 ? x + kOffset : x;
      const int above = y >= kOffset && view.depth(x, y - kOffset) > 0 ? y - kOffset : y;
      const int below = y + kOffset < result.height() && view.depth(x, y + kOffset) > 0 ? y + kOffset : y;
      if (left == right || above == below) continue;
      const Eigen::Vector3f normal = (point(right, y) - point(left, y)).cross(point(x, below) - point(x, above));
      const float length = normal.norm();
      if (length > 0) result(x, y) = std::abs(normal.dot(camera.ray(x, y).cast<float>())) / length;
    }
  return result;
}

DepthViewMaker::DepthViewMaker(const CameraModel& camera, const DenseOptions& options)
    : camera_(camera), options_(options) {
  const int step = options_.pixel_step;
  view_camera_.width = (camera.width + step - 1) / step;
  view_camera_.height = (camera.height + step - 1) / step;
  view_camera_.fx = camera.fx / step;
  view_camera_.fy = camera.fy / step;
  view_camera_.cx = camera.cx / step;
  view_camera_.cy = camera.cy / step;
  source_.assign(static_cast<size_t>(view_camera_.width) * static_cast<size_t>(view_camera_.height), -1);
  size_t i = 0;
  for (int y = 0; y < view_camera_.height; ++y)
    for (int x = 0; x < view_camera_.width; ++x, ++i) {
      const Eigen::Vector2d p = camera.distort({x * step, y * step});
      const int u = static_cast<int>(std::floor(p.x() + 0.5)), v = static_cast<int>(std::floor(p.y() + 0.5));
      if (u >= 0 && v >= 0 && u < camera.width && v < camera.height) source_[i] = v * camera.width + u;
    }
}

DepthView DepthViewMaker::make(FrameIndex frame, const RgbdImage& image, double depth_time,
                               const MoverMask& movers) const {
  DepthView view;
  view.frame = frame;
  view.depth_time = depth_time;
  view.depth = Image<uint16_t>(view_camera_.width, view_camera_.height);
  view.colour = ColourImage(view_camera_.width, view_camera_.height);
  for (size_t i = 0; i < source_.size(); ++i) {
    if (source_[i] < 0) continue;
    const auto s = static_cast<size_t>(source_[i]);
    const uint8_t grey = image.grey.data()[s];
    view.colour.data()[i] = image.colour.empty() ? Rgb{grey, grey, grey} : image.colour.data()[s];
    const float z = image.depth.data()[s];
    if (!(z > 0)) continue;
    const int u = source_[i] % camera_.width, v = source_[i] / camera_.width;
    if (on_one_surface(image.depth, u, v))
      view.depth.data()[i] = static_cast<uint16_t>(std::min(z * DepthView::kUnitsPerMetre + 0.5F, 65535.0F));
  }
  remove(movers, &view);
  return view;
}

void DepthViewMaker::remove(const MoverMask& movers, DepthView* view) const {
  if (movers.empty()) return;
  MoverMask wide = movers;
  dilate(wide, (options_.mover_margin + wide.cell - 1) / wide.cell);
  for (size_t i = 0; i < source_.size(); ++i)
    if (source_[i] >= 0 &&
        wide.at(static_cast<float>(source_[i] % camera_.width), static_cast<float>(source_[i] / camera_.width)))
      view->depth.data()[i] = 0;
}

}  // namespace dkb
