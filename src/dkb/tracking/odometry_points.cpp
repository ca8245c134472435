// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/odometry_points.h"

namespace dkb {
namespace {

constexpr float kSurroundings = 40;  // [px] within which features lend their depth

}  // namespace

std::vector<Candidate> OdometryPoints::candidates(const TrackedFrame& frame) const {
  const Rigid3 world_from_cam = frame.cam_from_world.inverse();
  std::vector<Candidate> result;
  result.reserve(points_.size());
  for (const Point& p : points_) {
    const Eigen::Vector3d position = world_from_cam * p.point_in_cam;
    result.push_back(
        candidate_of(*frame.features, static_cast<size_t>(p.feature), position, p.point_in_cam.norm(), scale_factor_));
  }
  return result;
}

// Harmonic mean of the depths of the features nearby, since parallax goes with the inverse depth; 0 when there is none.
float OdometryPoints::depth_around(const TrackedFrame& frame, const Keypoint& keypoint) {
  float sum = 0;
  int count = 0;
  frame.features->grid.for_each_near(keypoint.pixel.x(), keypoint.pixel.y(), kSurroundings, [&](int f) {
    const Keypoint& k = frame.features->keypoints[static_cast<size_t>(f)];
    if (!(k.depth > 0)) return;
    sum += 1.0f / k.depth;
    ++count;
  });
  return count > 0 ? static_cast<float>(count) / sum : 0.0f;
}

void OdometryPoints::remember(const TrackedFrame& frame) {
  points_.clear();
  for (size_t f = 0; f < frame.points.size(); ++f) {
    const Keypoint& k = frame.features->keypoints[f];
    if (frame.points[f] != kNoPoint || frame.outlier[f] || frame.matchable().on_mover(f)) continue;
    Point p;
    p.feature = static_cast<int>(f);
    p.guessed = !(k.depth > 0);
    const float depth = p.guessed ? depth_around(frame, k) : k.depth;
    if (!(depth > 0) || depth > max_depth_) continue;
    const auto& before = frame.odometry[f];
    if (before && !before->guessed)
      p.point_in_cam = frame.cam_from_world * before->point_in_world;
    else
      p.point_in_cam = camera_.unproject(k.pixel.cast<double>(), depth);
    p.guessed = p.guessed && (!before || before->guessed);
    points_.push_back(p);
  }
}

void OdometryPoints::drop_mapped(const TrackedFrame& frame) {
  std::erase_if(points_, [&](const Point& p) { return frame.points[static_cast<size_t>(p.feature)] != kNoPoint; });
}

}  // namespace dkb
