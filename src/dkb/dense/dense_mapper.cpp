// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/dense_mapper.h"

#include <algorithm>
#include <cmath>

#include "dkb/dense/floor_plane.h"
#include "dkb/geometry/motion_model.h"

namespace dkb {
namespace {

constexpr double kMinPatch = 0.03;  // [m^2] smaller connected surfaces are dropped

// The camera's pose at a time between or shortly beside two poses of the trajectory, at constant velocity.
std::optional<Rigid3> pose_at(std::span<const TimedPose> trajectory, double time) {
  if (trajectory.empty()) return std::nullopt;
  const auto later = [](double t, const TimedPose& p) { return t < p.timestamp; };
  auto next = std::upper_bound(trajectory.begin(), trajectory.end(), time, later);
  if (next == trajectory.end()) --next;
  if (next == trajectory.begin() && trajectory.size() > 1) ++next;
  const TimedPose& b = *next;
  const TimedPose& a = next == trajectory.begin() ? b : *(next - 1);
  const TimedPose& nearest = std::abs(time - a.timestamp) <= std::abs(time - b.timestamp) ? a : b;
  if (std::abs(time - nearest.timestamp) > kEvenMotion) return std::nullopt;
  const double gap = b.timestamp - a.timestamp;
  if (!(gap > 0) || gap > kEvenMotion) return nearest.world_from_cam;
  const double share = (time - a.timestamp) / gap;
  const Eigen::Vector3d rotation =
      vector_from_rotation(a.world_from_cam.rotation.conjugate() * b.world_from_cam.rotation);
  return Rigid3((a.world_from_cam.rotation * rotation_from_vector(share * rotation)).normalized(),
                a.world_from_cam.translation + share * (b.world_from_cam.translation - a.world_from_cam.translation));
}

}  // namespace

DenseMapper::DenseMapper(const CameraModel& camera, const SensorNoise& noise, const DenseOptions& options)
    : noise_(noise), options_(options), maker_(camera, options) {}

void DenseMapper::add_keyframe(FrameIndex frame, const RgbdImage& image, double depth_time, const MoverMask& movers) {
  views_.push_back(std::make_shared<const DepthView>(maker_.make(frame, image, depth_time, movers)));
}

void DenseMapper::remove_movers(FrameIndex frame, const MoverMask& movers) {
  for (auto view = views_.rbegin(); view != views_.rend() && (*view)->frame >= frame; ++view) {
    if ((*view)->frame != frame) continue;
    auto without = std::make_shared<DepthView>(**view);
    maker_.remove(movers, without.get());
    *view = std::move(without);
  }
}

DenseMap DenseMapper::build(std::span<const TimedPose> trajectory, uint64_t seed, const Rigid3& base_from_cam) const {
  std::vector<PlacedView> placed;
  const Eigen::Quaterniond& mount = base_from_cam.rotation;
  const bool mounted = mount.vec().norm() > 1e-9;
  const Eigen::Vector3d up_in_cam =
      mounted ? Eigen::Vector3d(mount.conjugate() * Eigen::Vector3d::UnitZ()) : Eigen::Vector3d(0, -1, 0);
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& view : views_)
    if (const auto world_from_cam = pose_at(trajectory, view->depth_time)) {
      placed.push_back({view.get(), world_from_cam->inverse()});
      up += world_from_cam->rotation * up_in_cam;
    }
  DenseMap map;
  map.views = static_cast<int>(placed.size());
  map.mesh =
      without_small_parts(extract_surface(TsdfVolume::fuse(placed, maker_.camera(), noise_, options_)), kMinPatch);
  if (placed.empty() || up.norm() < 1e-6) return map;
  if (const auto floor = find_floor(map.mesh, up, seed)) {
    const Eigen::Vector3d forward = placed.front().cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    map.grid = make_occupancy_grid(map.mesh, placed, maker_.camera(), floor_from_world(*floor, forward), options_);
  }
  return map;
}

}  // namespace dkb
