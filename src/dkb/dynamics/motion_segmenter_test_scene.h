// SPDX-License-Identifier: Apache-2.0
// A room that a swaying camera sees, with boxes that move in it.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "dkb/dynamics/motion_segmenter.h"
#include "dkb/geometry/motion_model.h"
#include "dkb/util/random.h"

namespace dkb {

// What is known of the motion since a frame a thirtieth of a second ago, by the velocity.
inline const Matrix6d kStepCovariance =
    axis_covariance(kAccelerationSd / (30 * 30), kAngularAccelerationSd / (30 * 30));

// An upright rectangle parallel to the wall [m, world: x right, y down, z away from the camera's start].
struct Panel {
  double x0, y0, x1, y1, z;
  bool mover = false;
};

struct Picture {
  RgbdImage image;
  GreyImage truth;  // 255 = mover
};

// A wall 3 m away, a pillar before it, and what the test puts in, seen by a camera that sways and turns.
class World {
 public:
  static constexpr int kWidth = 320, kHeight = 240;

  World() {
    camera.width = kWidth;
    camera.height = kHeight;
    camera.fx = camera.fy = 262;
    camera.cx = 159.5;
    camera.cy = 119.5;
  }

  Rigid3 cam_from_world(int frame) const {
    if (turn != 0) return Rigid3(rotation_from_vector({0, turn * frame, 0}), Eigen::Vector3d::Zero()).inverse();
    const double t = still_camera ? 0.0 : frame / rate;
    const Rigid3 world_from_cam(rotation_from_vector({0.03 * std::sin(2.0 * t), 0.05 * std::sin(1.5 * t), 0}),
                                {0.15 * std::sin(1.2 * t), 0.05 * std::sin(1.7 * t), 0.1 * std::sin(0.8 * t)});
    return world_from_cam.inverse();
  }

  Picture render(int frame, const std::vector<Panel>& movers) const {
    std::vector<Panel> panels{{-9, -9, 9, 9, 3.0}, {-1.0, -2, -0.7, 2, 2.2}};
    panels.insert(panels.end(), movers.begin(), movers.end());
    Picture p;
    p.image.timestamp = p.image.depth_timestamp = frame / rate;
    p.image.grey = GreyImage(kWidth, kHeight);
    p.image.depth = DepthImage(kWidth, kHeight);
    p.truth = GreyImage(kWidth, kHeight);
    const Rigid3 world_from_cam = cam_from_world(frame).inverse();
    Random random(static_cast<uint64_t>(frame) + 17);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector3d ray = world_from_cam.rotation * camera.unproject(Eigen::Vector2d(x, y), 1.0);
        double nearest = 99;
        for (const Panel& panel : panels) {
          const double z = (panel.z - world_from_cam.translation.z()) / ray.z();  // depth along the optical axis
          const Eigen::Vector3d point = world_from_cam.translation + z * ray;
          if (z >= nearest || point.x() < panel.x0 || point.x() > panel.x1 || point.y() < panel.y0 ||
              point.y() > panel.y1)
            continue;
          nearest = z;
          p.truth(x, y) = panel.mover ? 255 : 0;
        }
        const double sigma = 0.0012 + 0.0019 * (nearest - 0.4) * (nearest - 0.4);
        if (random.uniform() >= holes) p.image.depth(x, y) = static_cast<float>(nearest + sigma * random.normal());
      }
    return p;
  }

  CameraModel camera;
  bool still_camera = false;
  double turn = 0;   // [rad] to the right from frame to frame, in the place of the swaying
  double rate = 30;  // [Hz]
  double holes = 0;  // share of the pixels without depth
};

inline Panel box_at(double x, double z = 1.6) {
  return {x - 0.25, -0.4, x + 0.25, 0.4, z, true};
}

struct Figures {
  double covered = 1;  // share of the mover's pixels marked
  double wrong = 0;    // share of the rest marked, but for a band of 12 px around the mover
};

inline Figures judge(const MoverMask& mask, const GreyImage& truth) {
  int on = 0, hit = 0, off = 0, wrong = 0;
  for (int y = 0; y < truth.height(); ++y)
    for (int x = 0; x < truth.width(); ++x) {
      const bool marked = mask.at(static_cast<float>(x), static_cast<float>(y));
      if (truth(x, y) != 0) {
        ++on, hit += marked;
        continue;
      }
      bool near = false;
      for (int v = std::max(0, y - 12); v <= std::min(truth.height() - 1, y + 12); v += 4)
        for (int u = std::max(0, x - 12); u <= std::min(truth.width() - 1, x + 12); u += 4) near |= truth(u, v) != 0;
      if (!near) ++off, wrong += marked;
    }
  return {on > 0 ? static_cast<double>(hit) / on : 1.0, static_cast<double>(wrong) / std::max(1, off)};
}

inline MoverMask segment(MotionSegmenter& segmenter, const RgbdImage& image, const Rigid3& expected) {
  segmenter.observe(image, image.depth_timestamp, expected, kStepCovariance);
  return segmenter.mask();
}

// Runs frames 0 ... frames - 1 with poses off by 2 mm and 0.1 degrees, and hands each frame's figures to `look`.
inline void run(const World& world, int frames, const std::function<std::vector<Panel>(int)>& movers,
                const std::function<void(int, const MoverMask&, const Figures&)>& look, MotionOptions options = {}) {
  MotionSegmenter segmenter(world.camera, {}, options);
  Random random(3);
  for (int f = 0; f < frames; ++f) {
    const Picture p = world.render(f, movers(f));
    Vector6d error;
    for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? 0.002 : 0.0017) * random.normal();
    const MoverMask mask = segment(segmenter, p.image, rigid3_from_tangent(error) * world.cam_from_world(f));
    look(f, mask, judge(mask, p.truth));
    segmenter.commit(world.cam_from_world(f));
  }
}

}  // namespace dkb
