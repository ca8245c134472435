// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/odometry_points.h"

#include <algorithm>

#include "dkb/solver/pose_optimiser.h"

namespace dkb {
namespace {

constexpr double kSurroundings = 40;  // [px, usual focal length] within which features lend their depth
constexpr double kNearest = 0.3;      // [m] that anything is taken to be from the camera

SightRay transformed(const Rigid3& pose, const SightRay& ray) {
  return {pose * ray.origin, pose.rotation * ray.direction, ray.variance};
}

}  // namespace

std::vector<Candidate> OdometryPoints::candidates(const PosedFrame& frame) const {
  const Rigid3 world_from_cam = frame.cam_from_world.inverse();
  std::vector<Candidate> result;
  result.reserve(points_.size());
  for (const Point& p : points_) {
    const Eigen::Vector3d position = world_from_cam * p.point_in_cam;
    result.push_back(
        candidate_of(*frame.features, static_cast<size_t>(p.feature), position, p.point_in_cam.norm(), optics_));
  }
  return result;
}

OdometryMatch OdometryPoints::match(size_t i, const PosedFrame& frame) const {
  const Point& p = points_[i];
  const Rigid3 world_from_cam = frame.cam_from_world.inverse();
  return {world_from_cam * p.point_in_cam, p.guessed, transformed(world_from_cam, p.first_in_cam), p.moves};
}

// [px^2] mean over both directions in the image, of a corner and of where a pose puts its point.
double OdometryPoints::sight_variance(const Keypoint& keypoint, const Eigen::Vector3d& point_in_cam,
                                      const Matrix6d& covariance) const {
  const Eigen::Matrix<double, 2, 6> jacobian = pixel_by_motion(optics_.camera, point_in_cam);
  return optics_.corner_variance(keypoint) + (jacobian * covariance * jacobian.transpose()).trace() / 2;
}

double OdometryPoints::parallax_sigma(const OdometryMatch& guessed, const Rigid3& last_cam_from_world,
                                      const Rigid3& cam_from_world) const {
  const double depth = (last_cam_from_world * guessed.point_in_world).z();
  const double step = (centre_in_world(cam_from_world) - centre_in_world(last_cam_from_world)).norm();
  return optics_.camera.fx * step / (std::sqrt(3.0) * depth);
}

bool OdometryPoints::has_moved(const OdometryMatch& match, const Keypoint& keypoint, const Rigid3& cam_from_world,
                               const Matrix6d& covariance, double limit) const {
  const SightRay ray = transformed(cam_from_world, match.first);
  if (!(ray.direction.z() > 0)) return false;
  // It is seen from where it is near to either camera up to infinity.
  const double nearest = std::max(kNearest, (kNearest - ray.origin.z()) / ray.direction.z());
  const Eigen::Vector2d from = optics_.camera.project(ray.origin + nearest * ray.direction);
  const Eigen::Vector2d along = optics_.camera.project(ray.direction) - from;
  const Eigen::Vector2d seen = keypoint.pixel.cast<double>();
  const double length = along.squaredNorm();
  const double t = length > 0 ? std::clamp((seen - from).dot(along) / length, 0.0, 1.0) : 0.0;
  const double variance = ray.variance + sight_variance(keypoint, cam_from_world * match.point_in_world, covariance);
  return (seen - from - t * along).squaredNorm() > limit * variance;
}

// Harmonic mean of the depths of the features nearby, since parallax goes with the inverse depth. Where none has any,
// what is seen there lies beyond the reach of depth, or about as far.
float OdometryPoints::depth_around(const TrackedFrame& frame, const Keypoint& keypoint) const {
  const auto within = static_cast<float>(optics_.pixels(kSurroundings));
  float sum = 0;
  int count = 0;
  frame.features->grid.for_each_near({keypoint.pixel.x(), keypoint.pixel.y(), within}, [&](int f) {
    const Keypoint& k = frame.features->keypoints[static_cast<size_t>(f)];
    if (!(k.depth > 0)) return;
    sum += 1.0f / k.depth;
    ++count;
  });
  return count > 0 ? static_cast<float>(count) / sum : reach_;
}

void OdometryPoints::remember(const TrackedFrame& frame) {
  points_.clear();
  for (size_t f = 0; f < frame.points.size(); ++f) {
    const Keypoint& k = frame.features->keypoints[f];
    const auto& before = frame.odometry[f];
    const bool left_out = frame.outlier[f] && !(before && before->moves);
    if (frame.points[f] != kNoPoint || left_out || frame.matchable().on_mover(f)) continue;
    Point p;
    p.feature = static_cast<int>(f);
    p.guessed = !(k.depth > 0) && (!before || before->guessed);
    const float depth = k.depth > 0 ? k.depth : k.lent_depth > 0 ? k.lent_depth : depth_around(frame, k);
    if (depth > reach_) continue;
    p.point_in_cam = before && !before->guessed ? frame.cam_from_world * before->point_in_world
                                                : optics_.camera.unproject(k.pixel.cast<double>(), depth);
    if (p.guessed) {
      p.moves = before && before->moves;
      p.first_in_cam = before ? transformed(frame.cam_from_world, before->first)
                              : SightRay{Eigen::Vector3d::Zero(), p.point_in_cam / p.point_in_cam.z(),
                                         sight_variance(k, p.point_in_cam, frame.covariance)};
    }
    points_.push_back(p);
  }
}

void OdometryPoints::drop_mapped(const PosedFrame& frame) {
  std::erase_if(points_, [&](const Point& p) { return frame.points[static_cast<size_t>(p.feature)] != kNoPoint; });
}

}  // namespace dkb
