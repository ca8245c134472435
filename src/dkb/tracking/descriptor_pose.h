// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/map/ids.h"
#include "dkb/solver/absolute_pose.h"

namespace dkb {

// A map point as it looked where it was seen.
struct DescribedPoint {
  PointId id = kNoPoint;
  Eigen::Vector3d position;  // [m] in the world
  Descriptor descriptor;
};

struct DescriptorPose {
  Rigid3 cam_from_world;
  int inliers = 0;
  std::vector<PointId> points;  // per feature: the inlier that it shows, else kNoPoint
};

// Pose of the camera that sees `features`, without any idea of where it is: `known` points, each id once, are matched
// by descriptor alone, and RANSAC seeks the pose that most matches agree on. Features that may lie on movers take no
// part. Nothing with fewer than `min_matches` matches or where RANSAC finds no pose. Deterministic for a seed.
std::optional<DescriptorPose> pose_by_descriptors(const std::vector<DescribedPoint>& known,
                                                  const RgbdFeatures& features, const CameraModel& camera,
                                                  const SensorNoise& noise, double scale_factor, int min_matches,
                                                  const RansacOptions& ransac);

}  // namespace dkb
