// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/slam.h"
#include "report/overlay_picture.h"

namespace dkb::report {

// What the report keeps of a frame.
struct FrameRow {
  int64_t stamp_ns = 0;
  TrackingState state = TrackingState::initialising;
  bool keyframe = false;
  bool ambiguous = false;       // lost, before one of two places that look alike
  uint8_t rule = 0;             // of a keyframe, index into RunLog::rules()
  int features = 0;             // extracted
  int removed = 0;              // kept from tracking by the filter
  int with_depth = 0;           // of the others
  int inliers = 0;              // map points that the pose rests on; without one by the images, that a refused one does
  int misfits = 0;              // matched, but off from where they should be
  float masked = 0, depth = 0;  // shares of the image: on movers; with depth
  float brightness = 0;         // mean grey level
  float turned_deg = 0;         // since the frame before, when both have poses
  float position_sd = 0;        // [m] by the covariance; 0 = unknown
  float tracking_ms = 0, waiting_ms = 0;

  bool tracked() const { return state != TrackingState::initialising && state != TrackingState::lost; }
  bool by_images() const { return tracked() && state != TrackingState::predicted; }
};

// Something worth a line: a loop, a new map.
struct Happening {
  size_t row = 0;
  Event::Kind kind = Event::Kind::warning;
  std::string text;
};

// Listens to a run. Keeps 64 bytes a frame and at most 25 small pictures.
class RunLog {
 public:
  // `expected`: about how many frames there will be.
  explicit RunLog(std::optional<size_t> expected = {});
  void frame(const Frame& frame, const FrameResult& result);
  void event(const Event& event);  // of the last frame

  const std::vector<FrameRow>& rows() const { return rows_; }
  const std::vector<std::string>& rules() const { return rules_; }
  const std::vector<Happening>& happenings() const { return happenings_; }  // the first 200
  const std::vector<OverlayPicture>& lost() const { return lost_; }         // first of a stretch without poses
  std::vector<const OverlayPicture*> pictures() const;                      // all of them, by row, none twice

 private:
  void keep_pictures(const Frame& frame, const FrameResult& result);

  std::vector<FrameRow> rows_;
  std::vector<std::string> rules_;
  std::vector<Happening> happenings_;
  std::optional<Rigid3> last_pose_;
  size_t stride_;
  std::optional<size_t> first_tracked_;  // row
  std::vector<OverlayPicture> even_, lost_;
  std::optional<OverlayPicture> fewest_;  // with about the fewest inliers
};

}  // namespace dkb::report
