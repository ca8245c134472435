// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/descriptor_pose.h"

#include "dkb/features/matching.h"
#include "dkb/matching/pose_observation.h"

namespace dkb {

std::optional<DescriptorPose> pose_by_descriptors(const std::vector<DescribedPoint>& known,
                                                  const RgbdFeatures& features, const CameraModel& camera,
                                                  const SensorNoise& noise, double scale_factor, int min_matches,
                                                  const RansacOptions& ransac) {
  std::vector<Descriptor> descriptors;
  descriptors.reserve(known.size());
  for (const DescribedPoint& k : known) descriptors.push_back(k.descriptor);
  std::vector<DescriptorMatch> matches = match_brute_force(descriptors, features.descriptors);
  std::erase_if(matches,
                [&](const DescriptorMatch& m) { return features.keypoints[static_cast<size_t>(m.b)].suspect; });
  if (static_cast<int>(matches.size()) < min_matches) return std::nullopt;
  std::vector<PoseObservation> observations;
  observations.reserve(matches.size());
  for (const DescriptorMatch& m : matches)
    observations.push_back(pose_observation(features.keypoints[static_cast<size_t>(m.b)],
                                            known[static_cast<size_t>(m.a)].position, noise, scale_factor));
  const RansacPose pose = estimate_absolute_pose(camera, observations, ransac);
  if (!pose.ok) return std::nullopt;
  DescriptorPose found{pose.pose, pose.inliers, std::vector<PointId>(features.size(), kNoPoint)};
  for (size_t i = 0; i < matches.size(); ++i)
    if (pose.inlier[i]) found.points[static_cast<size_t>(matches[i].b)] = known[static_cast<size_t>(matches[i].a)].id;
  return found;
}

}  // namespace dkb
