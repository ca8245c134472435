// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/tracking_map.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace dkb {

void TrackingMap::take_view(MapView view) {
  view_ = std::move(view);
  std::erase_if(pending_, [&](const Pending& p) { return view_->keyframe(p.id) != nullptr; });
  for (Pending& p : pending_) p.world_from_cam = placed(p).inverse();
}

void TrackingMap::add_pending(KeyframeId id, KeyframeId reference, const Rigid3& cam_from_reference,
                              const Matrix6d& covariance) {
  pending_.push_back({id, reference, cam_from_reference, covariance, {}});
  pending_.back().world_from_cam = placed(pending_.back()).inverse();
}

const TrackingMap::Pending& TrackingMap::pending(KeyframeId id) const {
  const auto at = std::find_if(pending_.begin(), pending_.end(), [id](const Pending& p) { return p.id == id; });
  if (at == pending_.end()) throw std::logic_error("there is no keyframe " + std::to_string(id));
  return *at;
}

Rigid3 TrackingMap::cam_from_world(KeyframeId id) const {
  if (view_->keyframe(id) != nullptr) return view_->cam_from_world(id);
  return placed(pending(id));
}

Rigid3 TrackingMap::placed(const Pending& p) const {
  return p.reference == kNoKeyframe ? p.cam_from_reference : p.cam_from_reference * cam_from_world(p.reference);
}

Matrix6d TrackingMap::covariance(KeyframeId id) const {
  Matrix6d sum = Matrix6d::Zero();
  for (; view_->keyframe(id) == nullptr; id = pending(id).reference) {
    sum += carried(cam_from_world(id).inverse(), pending(id).covariance);
    if (pending(id).reference == kNoKeyframe) return sum;
  }
  return sum + carried(view_->cam_from_world(id).inverse(), view_->keyframe(id)->covariance);
}

KeyframeId TrackingMap::root(KeyframeId id) const {
  while (view_->keyframe(id) == nullptr) {
    const Pending& p = pending(id);
    if (p.reference == kNoKeyframe) return id;
    id = p.reference;
  }
  return view_->root(id);
}

}  // namespace dkb
