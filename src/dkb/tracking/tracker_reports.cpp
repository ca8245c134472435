// SPDX-License-Identifier: Apache-2.0
// What tracking tells mapping.
#include <algorithm>
#include <cmath>
#include <utility>

#include "dkb/tracking/tracker.h"

namespace dkb {
namespace {

constexpr int kMinNewPoints = 100;  // nearest depths that make points at a keyframe, however far they are

}  // namespace

KeyframePacket Tracker::make_report() {
  KeyframePacket packet;
  packet.visibility = visibility_.take();
  packet.retracted = std::exchange(unreported_, {});
  return packet;
}

bool Tracker::is_retracted(PointId id) const {
  return std::binary_search(retracted_.begin(), retracted_.end(), id);
}

void Tracker::retract(const std::vector<PointId>& points) {
  for (PointId id : points) {
    const auto at = std::lower_bound(retracted_.begin(), retracted_.end(), id);
    if (at != retracted_.end() && *at == id) continue;
    retracted_.insert(at, id);
    unreported_.push_back(id);
    provisional_.erase(id);
    if (last_)
      for (PointId& p : last_->points)
        if (p == id) p = kNoPoint;
  }
}

std::vector<PointInView> Tracker::points_in_view() const {
  std::vector<PointInView> in_view;
  if (!last_) return in_view;
  in_view.reserve(candidates_.size() + provisional_.size());
  const auto offer = [&](PointId id, const Eigen::Vector3d& world) {
    const Eigen::Vector3d p = last_->cam_from_world * world;
    if (p.z() < 0.1) return;
    if (const auto at = pixel_in_view(optics_.camera, p)) in_view.push_back({id, *at, p.z()});
  };
  const std::vector<uint8_t> skipped = candidates_to_skip({});
  for (size_t i = 0; i < from_view_; ++i)
    if (!skipped[i]) offer(candidates_[i].id, candidates_[i].position);
  for (const auto& [id, p] : provisional_) offer(id, map_.world_from_pending(birth_keyframe(id)) * p.point_in_keyframe);
  return in_view;
}

KeyframePacket Tracker::make_keyframe(KeyframeId id, const TrackedFrame& frame) {
  KeyframePacket packet = make_report();
  packet.id = id;
  packet.frame = frame.index;
  packet.timestamp = frame.timestamp;
  packet.features = frame.features;
  packet.reference = frame.reference;
  packet.cam_from_reference = frame.reference == kNoKeyframe ? frame.cam_from_world : frame.cam_from_reference;
  packet.points = frame.points;

  std::vector<std::pair<float, int>> by_depth;
  for (size_t f = 0; f < frame.points.size(); ++f) {
    const float z = frame.features->keypoints[f].depth;
    if (z > 0 && frame.points[f] == kNoPoint && !frame.outlier[f]) by_depth.emplace_back(z, static_cast<int>(f));
  }
  std::sort(by_depth.begin(), by_depth.end());
  for (const auto& [z, f] : by_depth) {
    if (z > options_.close_depth && static_cast<int>(packet.new_points.size()) >= kMinNewPoints) break;
    const Keypoint& k = frame.features->keypoints[static_cast<size_t>(f)];
    ProvisionalPoint p;
    p.id = make_point_id(id, f);
    p.point_in_keyframe = optics_.camera.unproject(k.pixel.cast<double>(), z);
    p.scale = optics_.scale(k.octave);
    p.descriptor = frame.features->descriptors[static_cast<size_t>(f)];
    packet.new_points.push_back(p);
  }

  const bool bridges = frame.starts_map && frame.predicted && packet.reference != kNoKeyframe;
  map_.add_pending(id, packet.reference, packet.cam_from_reference,
                   bridges ? frame.covariance : Matrix6d(Matrix6d::Zero()));
  for (const ProvisionalPoint& p : packet.new_points) provisional_.emplace(p.id, p);
  if (last_ && last_->index == frame.index) {
    for (const ProvisionalPoint& p : packet.new_points) last_->points[static_cast<size_t>(birth_feature(p.id))] = p.id;
    odometry_.drop_mapped(*last_);
    last_->reference = id;  // from here on the frame hangs on its own keyframe
    last_->cam_from_world = frame.cam_from_world;
    last_->cam_from_reference = {};
  }
  return packet;
}

}  // namespace dkb
