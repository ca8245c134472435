// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "dkb/geometry/decompositions.h"
#include "dkb/simulator/noise.h"
#include "dkb/simulator/scene.h"
#include "dkb/util/quantile.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDeskHeight = 0.74, kDeskWidth = 1.4, kDeskDepth = 0.75;  // [m]

// Rotation to a frame with z up in which the camera looks towards +y on average.
Eigen::Quaterniond upright(const std::vector<TimedPose>& poses) {
  Vector3d up = Vector3d::Zero(), forward = Vector3d::Zero();
  for (const TimedPose& p : poses) {
    up -= p.world_from_cam.rotation * Vector3d::UnitY();
    forward += p.world_from_cam.rotation * Vector3d::UnitZ();
  }
  up /= static_cast<double>(poses.size());
  forward /= static_cast<double>(poses.size());
  // Motion-capture worlds have z up. Others (the first camera's axes, say) take up from the pictures.
  const bool z_up = up.z() > 0.3 || forward.z() < -0.7;
  const Eigen::Quaterniond level =
      z_up ? Eigen::Quaterniond::Identity()
           : rotation_between(up.norm() > 1e-3 ? up : Vector3d(0, -1, 0), Vector3d::UnitZ());
  const Vector3d ahead = level * forward;
  const double yaw = std::hypot(ahead.x(), ahead.y()) > 0.15 ? std::atan2(ahead.y(), ahead.x()) : 1.5707963;
  return Eigen::Quaterniond(Eigen::AngleAxisd(1.5707963267948966 - yaw, Vector3d::UnitZ())) * level;
}

struct View {
  Vector3d eye, axis;
};

// Where the camera meets the height of a desk, or what lies 1.6 m ahead if it looks level or up.
Vector2d looked_at(const View& v) {
  const double drop = v.eye.z() - kDeskHeight;
  const double distance = v.axis.z() < -0.05 ? std::min(2.2, drop / -v.axis.z()) : 1.6;
  return v.eye.head<2>() + distance * v.axis.head<2>();
}

void place_desks(const std::vector<View>& views, const Footprint& room, Furnisher* furnisher) {
  for (double y = std::floor(room.y0 / kDeskDepth) * kDeskDepth; y + kDeskDepth < room.y1 - 0.5; y += kDeskDepth)
    for (double x = std::floor(room.x0 / kDeskWidth) * kDeskWidth + 0.3; x + kDeskWidth < room.x1 - 0.5;
         x += kDeskWidth) {
      if (x < room.x0 + 0.5 || y < room.y0 + 0.5) continue;
      const Footprint cell{x, y, x + kDeskWidth, y + kDeskDepth};
      size_t hits = 0;
      bool free = true, tall = true, low = false;
      for (const View& v : views) {
        const Vector2d p = looked_at(v);
        hits += cell.distance(p.x(), p.y()) < 0.35;
        const double near = cell.distance(v.eye.x(), v.eye.y()), above = v.eye.z() - kDeskHeight;
        free = free && (near > 0.45 || above > 0.4);
        tall = tall && near > 0.55;
        low = low || (near < 0.45 && above < 0.75);
      }
      if (!free || hits * 50 < views.size()) continue;
      furnisher->desk(placed(x + kDeskWidth / 2, y + kDeskDepth, 0, 3.141592653589793), kDeskWidth - 0.02,
                      kDeskDepth - 0.01,
                      low    ? Clutter::low
                      : tall ? Clutter::monitors
                             : Clutter::normal);
    }
}

void line_walls(const std::vector<View>& views, const Footprint& r, Furnisher* furnisher) {
  struct Side {
    Vector2d start, along;
    double length;
  };
  const double w = r.x1 - r.x0, d = r.y1 - r.y0;
  for (const Side& s : {Side{{r.x0, r.y0}, {1, 0}, w}, Side{{r.x1, r.y0}, {0, 1}, d}, Side{{r.x1, r.y1}, {-1, 0}, w},
                        Side{{r.x0, r.y1}, {0, -1}, d}}) {
    double gap = 1e9;
    const Vector2d inward(-s.along.y(), s.along.x());
    for (const View& v : views) gap = std::min(gap, inward.dot(v.eye.head<2>() - s.start));
    // Corners stay free for the neighbour's furniture.
    const double limit = gap > 1.3 ? 0.6 : gap > 0.9 ? 0.3 : 0.1;
    furnisher->line_wall(s.start + 0.62 * s.along, s.along, s.length - 1.24, limit);
  }
}

}  // namespace

Scene build_scene_around(const std::vector<TimedPose>& poses, const SceneRequest& request) {
  Scene scene;
  const double start = poses.front().time, duration = poses.back().time - start;
  std::vector<TimedPose> shifted = poses;
  for (TimedPose& p : shifted) p.time -= start;
  scene.start_stamp = start;
  const int available = static_cast<int>(std::floor(duration * request.fps + 1e-6)) + 1;
  scene.frames = std::min(request.frames > 0 ? request.frames : 300, available);
  const double used = (scene.frames - 1) / request.fps;
  const CameraPath world_path = smooth_path(shifted, 0.03, used + 1);  // exposures and depth stamps reach beyond

  std::vector<TimedPose> samples;
  for (double t = 0; t <= used + 1e-9; t += 0.1) samples.push_back({t, world_path(t)});
  Rigid3 scene_from_world(upright(samples), Vector3d::Zero());
  std::vector<View> views;
  std::vector<double> looked_heights;
  double lowest = 1e9, highest = -1e9;
  Vector2d middle = Vector2d::Zero();
  for (const TimedPose& p : samples) {
    const Rigid3 pose = scene_from_world * p.world_from_cam;
    views.push_back({pose.translation, pose.rotation * Vector3d::UnitZ()});
    looked_heights.push_back(pose.translation.z() + 1.1 * views.back().axis.z());
    lowest = std::min(lowest, pose.translation.z());
    highest = std::max(highest, pose.translation.z());
    middle += looked_at(views.back()) / static_cast<double>(samples.size());
  }
  // Desks stand where the camera looks from about 1.1 m; it stays above them.
  const double lift = std::max(kDeskHeight - upper_median(looked_heights), kDeskHeight + 0.42 - lowest);
  scene_from_world.translation = Vector3d(-middle.x(), -middle.y(), lift);
  Footprint room{1e9, 1e9, -1e9, -1e9};
  const auto include = [&](const Vector2d& p, double margin) {
    room = {std::min(room.x0, p.x() - margin), std::min(room.y0, p.y() - margin), std::max(room.x1, p.x() + margin),
            std::max(room.y1, p.y() + margin)};
  };
  for (View& v : views) {
    v.eye += scene_from_world.translation;
    include(v.eye.head<2>(), 1.5);
    include(looked_at(v), 1.3);
  }
  // At least 5 x 4.4 m.
  const double grow_x = std::max(0.0, 5.0 - (room.x1 - room.x0)) / 2,
               grow_y = std::max(0.0, 4.4 - (room.y1 - room.y0)) / 2;
  room = {room.x0 - grow_x, room.y0 - grow_y, room.x1 + grow_x, room.y1 + grow_y};

  Furnisher furnisher(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  furnisher.shell(room.x0, room.y0, room.x1, room.y1, std::max(2.7, highest + lift + 0.6), Material::planks);
  place_desks(views, room, &furnisher);
  line_walls(views, room, &furnisher);
  scene.inside = room;
  scene.world_from_scene = scene_from_world.inverse();
  scene.path = [scene_from_world, world_path](double t) { return scene_from_world * world_path(t); };
  if (request.people > 0) add_walkers(&scene, WalkArea{}, request.people, used, request);
  return scene;
}

}  // namespace dkb::sim
