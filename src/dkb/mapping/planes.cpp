// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/planes.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "dkb/geometry/decompositions.h"
#include "dkb/util/chi_square.h"

namespace dkb {
namespace {

constexpr int kBlock = PlaneView::kBlock;
constexpr size_t kNeighbours = 3;       // [keyframes] beside the previous one
constexpr int kEnoughBlocks = 6;        // in both views
constexpr size_t kEnoughKeyframes = 4;  // that see a plane: what fewer say, the motions between them say as well
// A narrow strip of floor along a wall lies within the wall's tolerance. The noise turns the smallest patch by 2
// degrees, and no turn loses as much; walls and floors meet at far more than 26.
constexpr double kSameTilt = 0.9;  // cosine
// What views of a plane from different places are off by, where the noise is that of the sensor and more: measured on a
// real Kinect (fr1_xyz), whose planes contradict each other by 15 to 27 mrad and 1 % of the distance.
constexpr double kTogether = 192;  // times the variance by the noise
constexpr double kTiltSd = 0.005;  // [rad]
constexpr double kDistanceShareSd = 0.01;
// In the plane a camera may be anywhere: that keeps the system solvable.
constexpr double kAnywhere = 1e-2;  // [1/m^2, 1/rad^2]

struct Sighting {
  int camera;
  const PlanePatch* patch;
};

// A plane's pose by one sighting: origin in the middle of what is seen, z along the normal.
Rigid3 cam_from_plane_of(const PlanePatch& patch) {
  const Eigen::Vector3d z = patch.normal(), x = z.unitOrthogonal();
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return {Eigen::Quaterniond(axes), patch.centre};
}

// Of [offset along the normal, tilt about x, tilt about y] at the patch's centre, in the axes of `cam_from_plane`,
// whose z is the patch's normal. With n = z and d the distance, over_distance = n / d, and the motion changes n by
// [tilt_y x - tilt_x y] and d by offset + tilt_y (x . centre) - tilt_x (y . centre).
Eigen::Matrix3d covariance_of(const PlanePatch& patch, const Rigid3& cam_from_plane) {
  const Eigen::Matrix3d axes = cam_from_plane.matrix3();
  const Eigen::Vector3d x = axes.col(0), y = axes.col(1), n = axes.col(2);
  const double d = patch.distance();
  Eigen::Matrix3d by_motion;
  by_motion.col(0) = -n / (d * d);
  by_motion.col(1) = -y / d + n * y.dot(patch.centre) / (d * d);
  by_motion.col(2) = x / d - n * x.dot(patch.centre) / (d * d);
  const Eigen::Matrix3d motion_by = by_motion.inverse();
  const double offset_sd = kDistanceShareSd * patch.centre.norm();
  const Eigen::Vector3d calibration(offset_sd * offset_sd, kTiltSd * kTiltSd, kTiltSd * kTiltSd);
  Eigen::Matrix3d covariance = kTogether * motion_by * patch.covariance * motion_by.transpose();
  covariance.diagonal() += calibration;
  return covariance;
}

// What a sighting says of the pose of plane `a` in camera `b`, which are at `cam_from_plane` now.
PoseEdge edge_of(int a, int b, const Rigid3& cam_from_plane, const PlanePatch& patch) {
  PoseEdge edge;
  edge.a = a;
  edge.b = b;
  edge.huber_chi2 = kChi2ThreeDof999;
  // The least motion that brings the plane to where it is seen.
  const Eigen::Vector3d n = patch.normal();
  const auto tilt = rotation_between(cam_from_plane.rotation * Eigen::Vector3d::UnitZ(), n);
  edge.b_from_a.rotation = (tilt * cam_from_plane.rotation).normalized();
  edge.b_from_a.translation = cam_from_plane.translation + (patch.distance() - n.dot(cam_from_plane.translation)) * n;
  const Eigen::Vector3d centre = edge.b_from_a.inverse() * patch.centre;
  Eigen::Matrix<double, 3, 6> at_centre;  // from a motion [translation, rotation] of the plane in its own axes
  at_centre << 0, 0, 1, centre.y(), -centre.x(), 0,  //
      0, 0, 0, 1, 0, 0,                              //
      0, 0, 0, 0, 1, 0;
  edge.information = at_centre.transpose() * covariance_of(patch, edge.b_from_a).inverse() * at_centre;
  edge.information.diagonal().array() += kAnywhere;
  return edge;
}

}  // namespace

PlaneRecogniser::PlaneRecogniser(const CameraModel& camera, const SensorNoise& noise)
    : camera_(camera), noise_(noise), rays_(camera.width / kBlock, camera.height / kBlock, Eigen::Vector2f::Zero()) {
  for (int y = 0; y < rays_.height(); ++y)
    for (int x = 0; x < rays_.width(); ++x) {
      const Eigen::Vector2d pixel(kBlock * (x + 0.5) - 0.5, kBlock * (y + 0.5) - 0.5);
      rays_(x, y) = camera.unproject(camera.undistort(pixel), 1).head<2>().cast<float>();
    }
}

std::vector<int> PlaneRecogniser::compare(const PlaneView& here, const PlaneView& there,
                                          const Rigid3& there_from_here) const {
  std::vector<int> looked(here.patches.size(), 0);
  std::vector<std::vector<int>> votes(here.patches.size(), std::vector<int>(there.patches.size(), 0));
  for (int y = 0; y < here.patch_at.height(); ++y)
    for (int x = 0; x < here.patch_at.width(); ++x) {
      if (here.patch_at(x, y) == 0) continue;
      const auto patch = static_cast<size_t>(here.patch_at(x, y) - 1);
      const Eigen::Vector3d ray = rays_(x, y).homogeneous().cast<double>();
      const Eigen::Vector3d point = there_from_here * Eigen::Vector3d(ray / here.patches[patch].over_distance.dot(ray));
      if (!(point.z() >= camera_.depth_min)) continue;
      const auto pixel = image_pixel(camera_, point);
      if (!pixel) continue;
      const double u = std::floor((pixel->x() + 0.5) / kBlock), v = std::floor((pixel->y() + 0.5) / kBlock);
      if (!(u >= 0 && v >= 0 && u < rays_.width() && v < rays_.height())) continue;
      ++looked[patch];
      const uint8_t seen = there.patch_at(static_cast<int>(u), static_cast<int>(v));
      if (seen == 0) continue;
      const PlanePatch& plane = there.patches[seen - 1u];
      const Eigen::Vector3d normal = there_from_here.rotation * here.patches[patch].normal();
      if (normal.dot(plane.normal()) < kSameTilt) continue;
      const double off = plane.normal().dot(point) - plane.distance();
      if (std::abs(off) <= noise_.surface_tolerance(point.z())) ++votes[patch][seen - 1u];
    }
  std::vector<int> same(here.patches.size(), -1);
  for (size_t p = 0; p < same.size(); ++p) {
    const auto most = std::max_element(votes[p].begin(), votes[p].end());
    if (most != votes[p].end() && *most >= kEnoughBlocks && 2 * *most >= looked[p])
      same[p] = static_cast<int>(most - votes[p].begin());
  }
  return same;
}

void PlaneRecogniser::recognise(Map& map, KeyframeId id) const {
  const Keyframe& here = *map.keyframe(id);
  std::vector<KeyframeId> others;
  if (here.motion) others.push_back(here.motion->previous);
  for (const Covisible& c : here.covisible)
    if (others.size() <= kNeighbours && std::find(others.begin(), others.end(), c.keyframe) == others.end())
      others.push_back(c.keyframe);
  std::vector<PlaneId> planes(here.planes->patches.size(), kNoPlane);
  for (KeyframeId other : others) {
    const Keyframe& there = *map.keyframe(other);
    if (!there.planes) continue;
    const Rigid3 there_from_here = there.cam_from_world * here.cam_from_world.inverse();
    const std::vector<int> same = compare(*here.planes, *there.planes, there_from_here);
    for (size_t p = 0; p < same.size(); ++p) {
      if (same[p] < 0) continue;
      const PlaneId plane = map.plane(there.plane_of_patch[static_cast<size_t>(same[p])]);
      if (planes[p] == kNoPlane)
        planes[p] = plane;
      else
        map.join_planes(planes[p], plane);
    }
  }
  for (PlaneId& plane : planes) plane = plane == kNoPlane ? map.add_plane() : map.plane(plane);
  map.name_planes(id, std::move(planes));
}

void add_planes(const Map& map, const std::vector<KeyframeId>& keyframes, BaProblem& problem) {
  std::map<PlaneId, std::vector<Sighting>> planes;
  for (size_t c = 0; c < keyframes.size(); ++c) {
    const Keyframe& k = *map.keyframe(keyframes[c]);
    for (size_t p = 0; p < k.plane_of_patch.size(); ++p)
      planes[map.plane(k.plane_of_patch[p])].push_back({static_cast<int>(c), &k.planes->patches[p]});
  }
  for (const auto& [id, sightings] : planes) {
    const bool all_fixed = std::all_of(sightings.begin(), sightings.end(), [&](const Sighting& s) {
      return problem.fixed[static_cast<size_t>(s.camera)] != 0;
    });
    // Two regions of a view may be of one plane; sightings are by increasing camera.
    size_t seen_by = 0;
    for (int last = -1; const Sighting& s : sightings) seen_by += std::exchange(last, s.camera) != s.camera;
    if (all_fixed || seen_by < kEnoughKeyframes) continue;
    const auto camera = [&](const Sighting& s) { return problem.cam_from_world[static_cast<size_t>(s.camera)]; };
    const Sighting& first = sightings.front();
    const Rigid3 world_from_plane = camera(first).inverse() * cam_from_plane_of(*first.patch);
    const int plane = static_cast<int>(problem.cam_from_world.size());
    for (const Sighting& s : sightings)
      problem.motions.push_back(edge_of(plane, s.camera, camera(s) * world_from_plane, *s.patch));
    problem.cam_from_world.push_back(world_from_plane.inverse());
    problem.fixed.push_back(0);
  }
}

}  // namespace dkb
