// SPDX-License-Identifier: Apache-2.0
#include "outputs.h"

#include <algorithm>
#include <cmath>

namespace dkb_ros {
namespace {

dkb::Rgb colour_of(dkb::FeatureState state) {
  switch (state) {
    case dkb::FeatureState::used:
      return {0, 230, 0};
    case dkb::FeatureState::dynamic:
      return {230, 0, 0};
    case dkb::FeatureState::outlier:
      return {230, 200, 0};
    case dkb::FeatureState::unused:
      break;
  }
  return {150, 150, 150};
}

}  // namespace

ColourImageOutput draw_features(const dkb::ImageView& image, const dkb::FrameResult& result) {
  ColourImageOutput drawn;
  drawn.width = image.width;
  drawn.height = image.height;
  drawn.rgb.resize(static_cast<size_t>(image.width) * static_cast<size_t>(image.height) * 3);
  const int channels = dkb::bytes_per_pixel(image.format);
  const bool grey = channels == 1;
  const bool bgr = image.format == dkb::PixelFormat::bgr8 || image.format == dkb::PixelFormat::bgra8;
  uint8_t* to = drawn.rgb.data();
  for (int y = 0; y < image.height; ++y) {
    const uint8_t* from = image.row(y);
    for (int x = 0; x < image.width; ++x, from += channels, to += 3) {
      to[0] = from[grey || !bgr ? 0 : 2];
      to[1] = from[grey ? 0 : 1];
      to[2] = from[grey || bgr ? 0 : 2];
    }
  }
  for (const dkb::FeatureReport& f : result.features) {
    const int cx = static_cast<int>(std::lround(f.image_x)), cy = static_cast<int>(std::lround(f.image_y));
    const dkb::Rgb colour = colour_of(f.state);
    for (int y = std::max(cy - 1, 0); y <= std::min(cy + 1, image.height - 1); ++y)
      for (int x = std::max(cx - 1, 0); x <= std::min(cx + 1, image.width - 1); ++x) {
        uint8_t* pixel =
            drawn.rgb.data() + 3 * (static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x));
        pixel[0] = colour.r, pixel[1] = colour.g, pixel[2] = colour.b;
      }
  }
  return drawn;
}

std::string hindrance_of(const dkb::FrameResult& result) {
  if (result.ambiguous) return "not localised: what is in view may be another place that looks alike";
  switch (result.state) {
    case dkb::TrackingState::predicted:
      return "carried by a motion prior or depth alone";
    case dkb::TrackingState::initialising:
    case dkb::TrackingState::lost:
      return "not localised";
    default:
      return "";
  }
}

int loaded_maps(const std::vector<dkb::TrajectoryFrame>& keyframes) {
  int maps = 0;
  for (const dkb::TrajectoryFrame& k : keyframes)
    if (k.frame < 0) maps = std::max(maps, k.map + 1);
  return maps;
}

MoversOutput movers_of(const dkb::FrameResult& result) {
  MoversOutput out;
  out.stamp_ns = result.stamp_ns;
  if (result.world_from_cam) out.axes = result.world_from_cam->rotation;
  for (const dkb::Mover& m : result.movers)
    out.movers.push_back({m.id, m.class_name, m.position_in_world, m.velocity_in_world, m.size, m.covariance, m.box.x,
                          m.box.y, m.box.w, m.box.h});
  return out;
}

CloudOutput cloud_of(const std::vector<dkb::PointInfo>& points) {
  CloudOutput out;
  out.points.reserve(points.size());
  for (const dkb::PointInfo& p : points)
    out.points.push_back({p.position_in_world.cast<float>(), p.colour.r, p.colour.g, p.colour.b});
  return out;
}

std::vector<PathOutput::Pose> path_of(const std::vector<dkb::TrajectoryFrame>& trajectory, const Rigid3& cam_from_base,
                                      double step, int placed) {
  constexpr double kTurn = 10 * M_PI / 180;
  std::vector<PathOutput::Pose> path;
  size_t end = trajectory.size();
  while (placed > 0 && end > 0 && trajectory[end - 1].map >= placed) --end;
  for (size_t i = 0; i < end; ++i) {
    if (trajectory[i].map != trajectory[end - 1].map) continue;
    const PathOutput::Pose pose{trajectory[i].stamp_ns, trajectory[i].world_from_cam * cam_from_base};
    const bool last = i + 1 == end;
    if (path.empty() || last || (pose.pose.translation - path.back().pose.translation).norm() >= step ||
        pose.pose.rotation.angularDistance(path.back().pose.rotation) >= kTurn)
      path.push_back(pose);
  }
  return path;
}

GridOutput grid_in_map(const dkb::OccupancyGrid& grid) {
  const Rigid3 world_from_floor = grid.floor_from_world.inverse();
  const int width = grid.cells.width(), height = grid.cells.height();
  // The grid's corners on the floor, in the map.
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  double z = 0;
  for (const int x : {0, width})
    for (const int y : {0, height}) {
      const Eigen::Vector3d corner =
          world_from_floor * Eigen::Vector3d(grid.origin_x + x * grid.cell, grid.origin_y + y * grid.cell, 0);
      low = low.cwiseMin(corner.head<2>());
      high = high.cwiseMax(corner.head<2>());
      z += corner.z() / 4;
    }
  GridOutput out;
  out.cell = grid.cell;
  out.floor_z = z;
  // Whole cells from the origin on, so that a growing grid keeps its raster.
  out.origin_x = std::floor(low.x() / grid.cell) * grid.cell;
  out.origin_y = std::floor(low.y() / grid.cell) * grid.cell;
  out.width = static_cast<int>(std::ceil((high.x() - out.origin_x) / grid.cell));
  out.height = static_cast<int>(std::ceil((high.y() - out.origin_y) / grid.cell));
  out.cells.reserve(static_cast<size_t>(out.width) * static_cast<size_t>(out.height));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const Eigen::Vector3d centre(out.origin_x + (x + 0.5) * out.cell, out.origin_y + (y + 0.5) * out.cell, z);
      const Eigen::Vector3d on_floor = grid.floor_from_world * centre;
      const int column = static_cast<int>(std::floor((on_floor.x() - grid.origin_x) / grid.cell));
      const int row = height - 1 - static_cast<int>(std::floor((on_floor.y() - grid.origin_y) / grid.cell));
      int8_t value = -1;
      if (grid.cells.contains(column, row)) {
        const uint8_t cell = grid.cells(column, row);
        if (cell == dkb::OccupancyGrid::kOccupied) value = 100;
        if (cell == dkb::OccupancyGrid::kFree) value = 0;
      }
      out.cells.push_back(value);
    }
  return out;
}

}  // namespace dkb_ros
