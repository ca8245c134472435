// SPDX-License-Identifier: Apache-2.0
#include "report/run_log.h"

#include <algorithm>
#include <cmath>

namespace dkb::report {
namespace {

constexpr size_t kEvenPictures = 16, kLostPictures = 8, kHappenings = 200;
constexpr int kGrid = 32;  // [px] between the pixels by which an image is judged

void judge_image(const Frame& frame, FrameRow& row) {
  const ImageView grey = frame.grey(), depth = frame.depth();
  int pixels = 0, with_depth = 0;
  double sum = 0;
  for (int y = kGrid / 2; y < grey.height; y += kGrid)
    for (int x = kGrid / 2; x < grey.width; x += kGrid) {
      ++pixels;
      sum += grey.row(y)[x];
      with_depth += reinterpret_cast<const float*>(depth.row(y))[x] > 0;
    }
  if (pixels == 0) return;
  row.brightness = static_cast<float>(sum / pixels);
  row.depth = static_cast<float>(with_depth) / static_cast<float>(pixels);
}

float masked_share(const MoverMask& mask) {
  if (mask.empty()) return 0;
  const auto marked =
      std::count_if(mask.cells.data(), mask.cells.data() + mask.cells.size(), [](uint8_t cell) { return cell != 0; });
  return static_cast<float>(marked) / static_cast<float>(mask.cells.size());
}

}  // namespace

RunLog::RunLog(std::optional<size_t> expected)
    : stride_(expected ? std::max<size_t>(1, (*expected + kEvenPictures - 1) / kEvenPictures) : 8) {}

void RunLog::frame(const Frame& frame, const FrameResult& result) {
  FrameRow row;
  row.stamp_ns = result.stamp_ns;
  row.state = result.state;
  row.keyframe = result.keyframe;
  row.ambiguous = result.ambiguous;
  row.inliers = row.by_images() ? result.inliers : result.refused_inliers;
  row.features = static_cast<int>(result.features.size());
  row.with_depth = result.with_depth;
  for (const FeatureReport& f : result.features) {
    row.removed += f.state == FeatureState::dynamic;
    row.misfits += f.state == FeatureState::outlier;
  }
  row.masked = masked_share(result.mask);
  row.tracking_ms = static_cast<float>(result.tracking_ms);
  row.waiting_ms = static_cast<float>(result.waiting_ms);
  judge_image(frame, row);
  if (result.world_from_cam && last_pose_) {
    const Rigid3 moved = last_pose_->inverse() * *result.world_from_cam;
    row.turned_deg = static_cast<float>(2 * std::atan2(moved.rotation.vec().norm(), std::abs(moved.rotation.w())) *
                                        180 / 3.14159265358979);
  }
  if (result.covariance)
    row.position_sd = static_cast<float>(std::sqrt(result.covariance->topLeftCorner<3, 3>().trace()));
  last_pose_ = result.world_from_cam;
  rows_.push_back(row);
  keep_pictures(frame, result);
}

void RunLog::keep_pictures(const Frame& frame, const FrameResult& result) {
  const size_t row = rows_.size() - 1;
  if (row % stride_ == 0) {
    even_.push_back(take_picture(row, frame, result));
    if (even_.size() > kEvenPictures) {
      stride_ *= 2;
      std::erase_if(even_, [&](const OverlayPicture& p) { return p.row % stride_ != 0; });
    }
  }
  const bool was_tracked = row > 0 && rows_[row - 1].tracked();
  if (was_tracked && !result.tracked() && lost_.size() < kLostPictures)
    lost_.push_back(take_picture(row, frame, result));
  // Each a tenth below the one before, so that a slow decline does not cost a picture a frame.
  if (!rows_[row].by_images()) return;
  if (!first_tracked_) first_tracked_ = row;
  if (10 * result.inliers < 9 * rows_[fewest_ ? fewest_->row : *first_tracked_].inliers)
    fewest_ = take_picture(row, frame, result);
}

void RunLog::event(const Event& event) {
  if (rows_.empty()) return;
  if (event.kind == Event::Kind::keyframe) {
    auto rule = std::find(rules_.begin(), rules_.end(), event.text);
    if (rule == rules_.end() && rules_.size() < 255) rule = rules_.insert(rule, event.text);
    rows_.back().rule = static_cast<uint8_t>(rule - rules_.begin());
  } else if (happenings_.size() < kHappenings) {
    happenings_.push_back({rows_.size() - 1, event.kind, event.text});
  }
}

std::vector<const OverlayPicture*> RunLog::pictures() const {
  std::vector<const OverlayPicture*> all;
  for (const OverlayPicture& p : even_) all.push_back(&p);
  for (const OverlayPicture& p : lost_) all.push_back(&p);
  if (fewest_) all.push_back(&*fewest_);
  std::stable_sort(all.begin(), all.end(), [](auto* a, auto* b) { return a->row < b->row; });
  all.erase(std::unique(all.begin(), all.end(), [](auto* a, auto* b) { return a->row == b->row; }), all.end());
  return all;
}

}  // namespace dkb::report
