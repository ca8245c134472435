// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/carried_objects.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "dkb/detection/mask_folder.h"
#include "dkb/features/optical_flow.h"

namespace dkb {
namespace {

constexpr size_t kPointsPerBox = 40;  // features followed to carry a box
constexpr int kMissedResults = 2;     // detector results that may miss an object before its box is dropped

// What `from` marks in a box is marked in `to` as well; an empty `to` takes its size.
void keep_within(const Box& box, const GreyImage& from, GreyImage& to) {
  if (from.empty()) return;
  if (to.empty()) to = GreyImage(from.width(), from.height());
  for_each_pixel(box, to.width(), to.height(), [&](int x, int y) {
    if (from(x, y) != 0) to(x, y) = from(x, y);
  });
}

}  // namespace

std::vector<PointMotion> CarriedObjects::motions(const PastFrame& from, const ImagePyramid& to,
                                                 const std::vector<Detection>& boxes) const {
  std::vector<Eigen::Vector2f> points;
  std::vector<uint8_t> chosen(from.corners.size(), 0);
  for (const Detection& d : boxes) {
    std::vector<size_t> inside;
    for (size_t i = 0; i < from.corners.size(); ++i)
      if (!chosen[i] && d.box.contains(from.corners[i].x(), from.corners[i].y())) inside.push_back(i);
    const size_t step = std::max<size_t>(1, inside.size() / kPointsPerBox);
    for (size_t k = 0; k < inside.size(); k += step) {
      chosen[inside[k]] = 1;
      points.push_back(from.corners[inside[k]]);
    }
  }
  std::vector<PointMotion> motions;
  const auto results = track_flow(*from.pyramid, to, points);
  for (size_t i = 0; i < points.size(); ++i)
    if (results[i].found) motions.push_back({points[i], results[i].position});
  return motions;
}

Detections CarriedObjects::carry_to(const PastFrame& from, const ImagePyramid& to, const Detections& detections,
                                    int frames) const {
  if (frames == 0) return detections;
  return carry(detections, motions(from, to, detections.boxes), frames, camera_.width, camera_.height);
}

std::vector<Detection> CarriedObjects::boxes() const {
  std::vector<Detection> boxes;
  for (const Carried& c : carried_) boxes.push_back(c.detection);
  return boxes;
}

std::vector<Detection> CarriedObjects::unmasked_boxes() const {
  std::vector<Detection> boxes;
  for (const Carried& c : carried_)
    if (!c.masked) boxes.push_back(c.detection);
  return boxes;
}

void CarriedObjects::follow(const PastFrames& past, const ImagePyramid& pyramid) {
  if (carried_.empty()) mask_ = {};  // what it showed has left the image
  if (past.empty() || carried_.empty()) return;
  const Detections here{boxes(), std::move(mask_)};
  std::vector<size_t> kept;
  Detections there = carry(here, motions(past.back(), pyramid, here.boxes), 1, camera_.width, camera_.height, &kept);
  std::vector<Carried> moved;
  for (size_t i = 0; i < kept.size(); ++i) {
    const Carried& before = carried_[kept[i]];
    moved.push_back({there.boxes[i], before.missed, before.masked});
  }
  carried_ = std::move(moved);
  mask_ = std::move(there.mask);
}

MoverMask CarriedObjects::with_rim(const GreyImage& mask) const {
  MoverMask wide;
  unite(wide, {1, mask}, camera_.width, camera_.height);
  dilate(wide, kSilhouetteRim);
  return wide;
}

std::vector<LateMask> CarriedObjects::receive(FrameIndex from, const Detections& answer, const PastFrames& past) {
  std::vector<LateMask> late;
  Detections detections = answer;
  // Boxes to carry a mask by, where the detector gives none.
  if (detections.boxes.empty()) detections.boxes = mover_boxes(detections.mask, MaskFolder::min_region);
  Detections here = detections;
  const auto source = std::find_if(past.begin(), past.end(), [&](const PastFrame& p) { return p.frame == from; });
  if (source != past.end()) {
    for (const PastFrame& p : past) {
      if (!p.keyframe || detections.boxes.empty()) continue;
      const Detections there = carry_to(*source, *p.pyramid, detections, std::abs(p.frame - from));
      const auto unmasked = there.mask.empty() ? there.boxes : std::vector<Detection>();
      LateMask mask{p.frame, without_still(silhouettes(p.image->depth, unmasked, camera_, noise_), p.still).mask};
      unite(mask.mask, with_rim(there.mask), camera_.width, camera_.height);
      late.push_back(std::move(mask));
    }
    here = carry_to(*source, *past.back().pyramid, detections, past.back().frame - from);
  }
  std::vector<Carried> next;
  for (const Detection& d : here.boxes) next.push_back({d, 0, !answer.mask.empty()});
  // What the detector overlooks once or twice does not vanish.
  for (const Carried& old : carried_) {
    const bool seen_again = std::any_of(here.boxes.begin(), here.boxes.end(), [&](const Detection& d) {
      return intersection_over_union(d.box, old.detection.box) > 0.3f;
    });
    if (seen_again || old.missed == kMissedResults) continue;
    next.push_back({old.detection, old.missed + 1, old.masked});
    if (old.masked) keep_within(old.detection.box, mask_, here.mask);
  }
  carried_ = std::move(next);
  mask_ = std::move(here.mask);
  return late;
}

}  // namespace dkb
