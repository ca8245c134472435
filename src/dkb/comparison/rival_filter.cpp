// SPDX-License-Identifier: Apache-2.0
#include "dkb/comparison/rival_filter.h"

#include <algorithm>
#include <utility>

#include "dkb/features/optical_flow.h"
#include "dkb/solver/absolute_pose.h"
#include "dkb/solver/pose_optimiser.h"

namespace dkb {
namespace {

float depth_near(const DepthImage& depth, float x, float y) {
  const int ix = static_cast<int>(x + 0.5f), iy = static_cast<int>(y + 0.5f);
  return depth.contains(ix, iy) ? depth(ix, iy) : 0.0f;
}

}  // namespace

std::vector<FilterFeature> RivalFilter::describe(const RivalFilterInput& input) const {
  const auto& corners = input.orb.corners;
  std::vector<FilterFeature> features(corners.size());
  std::vector<Eigen::Vector2f> points(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    FilterFeature& f = features[i];
    points[i] = {corners[i].x, corners[i].y};
    f.image_pixel = points[i].cast<double>();
    f.pixel = input.undistort(corners[i].x, corners[i].y).cast<double>();
    f.depth = depth_near(input.image.depth, corners[i].x, corners[i].y);
  }
  if (!needs_pyramid() || input.boxes.empty() || input.previous == nullptr) return features;
  const auto results = track_flow(*input.pyramid, *input.previous->pyramid, points);
  for (size_t i = 0; i < features.size(); ++i) {
    if (!results[i].found) continue;
    const Eigen::Vector2f at = results[i].position;
    features[i].flowed = true;
    features[i].previous_pixel = input.undistort(at.x(), at.y()).cast<double>();
    features[i].previous_depth = depth_near(input.previous->image->depth, at.x(), at.y());
  }
  return features;
}

// DKB section 3.1, with our decision: the motion comes from points outside all boxes; too few of them, or too lopsided,
// and it comes from all points by RANSAC; the expected motion stands where neither gives one.
Rigid3 RivalFilter::own_motion(const std::vector<FilterFeature>& features, const RivalFilterInput& input) const {
  const auto box = box_of_each(features, input.boxes);
  const auto observe = [&](bool outside_only) {
    std::vector<PoseObservation> observations;
    std::vector<uint8_t> cells(9, 0);
    for (size_t i = 0; i < features.size(); ++i) {
      const FilterFeature& f = features[i];
      if (!f.flowed || !(f.previous_depth > 0) || (outside_only && box[i] >= 0)) continue;
      PoseObservation o;
      o.point_in_world = camera_.unproject(f.previous_pixel, f.previous_depth);
      o.pixel = f.pixel;
      observations.push_back(o);
      const int column = std::clamp(static_cast<int>(3 * f.pixel.x() / camera_.width), 0, 2);
      const int row = std::clamp(static_cast<int>(3 * f.pixel.y() / camera_.height), 0, 2);
      cells[static_cast<size_t>(3 * row + column)] = 1;
    }
    return std::pair(observations, std::count(cells.begin(), cells.end(), uint8_t{1}));
  };
  auto [outside, cells] = observe(true);
  if (outside.size() >= 20 && cells >= 3) {
    const PoseEstimate pose = optimise_pose(camera_, input.current_from_previous, outside);
    return pose.ok ? pose.cam_from_world : input.current_from_previous;
  }
  const RansacPose pose = estimate_absolute_pose(camera_, observe(false).first);
  return pose.ok ? pose.pose : input.current_from_previous;
}

std::vector<uint8_t> RivalFilter::dynamic(const RivalFilterInput& input) const {
  const std::vector<FilterFeature> features = describe(input);
  std::vector<uint8_t> dynamic(features.size(), 0);
  switch (kind_) {
    case FilterKind::box: {
      const std::vector<int> box = box_of_each(features, input.boxes);
      std::transform(box.begin(), box.end(), dynamic.begin(), [](int b) { return b >= 0; });
      break;
    }
    case FilterKind::epipolar:
      return epipolar_filter(features, input.boxes, camera_, own_motion(features, input));
    case FilterKind::paper:
      return paper_filter(features, input.boxes, camera_, own_motion(features, input), paper_);
    case FilterKind::multiview:
      return multiview_filter(features, input.seen_in_camera, camera_, input.image.depth);
    case FilterKind::none:
    case FilterKind::standard:
      break;
  }
  return dynamic;
}

}  // namespace dkb
