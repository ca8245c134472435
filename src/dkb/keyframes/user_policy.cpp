// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/user_policy.h"

#include <algorithm>
#include <utility>

namespace dkb {

KeyframeDecision UserKeyframeDecider::decide(const KeyframeContext& context, const Map& map) {
  KeyframeQuery q;
  q.frame = context.frame;
  q.stamp_ns = context.stamp_ns;
  q.frames_since_keyframe = context.frame - context.last_keyframe_frame;
  q.seconds_since_keyframe = 1e-9 * static_cast<double>(context.stamp_ns - context.last_keyframe_stamp_ns);
  q.mapper_idle = context.mapper_idle;
  q.tracked_close_points = context.tracked_close_points;
  q.creatable_close_points = context.creatable_close_points;
  q.reference_points = context.reference_points;
  q.world_from_cam = context.cam_from_world.inverse();
  q.world_from_last_keyframe = context.last_keyframe_cam_from_world.inverse();
  std::vector<PointId> in_last;
  if (const Keyframe* last = map.live_keyframe(context.last_keyframe)) in_last = last->points;
  std::sort(in_last.begin(), in_last.end());
  for (size_t f = 0; f < context.points->size(); ++f) {
    const PointId id = (*context.points)[f];
    if (id == kNoPoint || !context.positions[f]) continue;
    const MapPoint* p = map.point(id);
    q.points.push_back({context.features->keypoints[f].pixel, *context.positions[f],
                        p == nullptr ? 0 : static_cast<int>(p->observations.size()),
                        std::binary_search(in_last.begin(), in_last.end(), id)});
  }
  KeyframeAnswer answer = policy_->decide(q);
  return {answer.insert, answer.insert ? KeyframeRule::own : KeyframeRule::none, std::move(answer.explanation)};
}

}  // namespace dkb
