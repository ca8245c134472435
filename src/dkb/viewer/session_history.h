// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "dkb/geometry/alignment.h"
#include "dkb/map/map.h"
#include "dkb/viewer/map_deltas.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/viewer.h"

namespace dkb {

// What charts and the path need of a frame.
struct FrameFact {
  int frame = 0;
  int64_t stamp_ns = 0;
  float tracking_ms = 0;
  uint16_t inliers = 0;
  TrackingState state = TrackingState::initialising;
  bool made_keyframe = false;
  KeyframeId host = kNoKeyframe;                               // that the camera's position hangs on; of tracked frames
  Eigen::Vector3d position_in_host = Eigen::Vector3d::Zero();  // [m] in the axes of its camera
  std::vector<StageTime> stages;
};

struct SessionEvent {
  std::string kind, text;
  int frame = 0;
  int64_t stamp_ns = 0;  // of it
};

// The session so far as a late client is told it. Bounded however long it lasts: the charts reach back ten minutes,
// the stages' times one, the path gets coarser, the events are the newest.
class SessionHistory {
 public:
  static constexpr size_t kFacts = 18000, kPath = 20000, kEvents = 500, kStages = 2000;

  void add(FrameFact fact);
  void add(SessionEvent event);
  void clear_path();

  struct Client {
    uint64_t facts = 0, events = 0, stages = 0, path_generation = 0;
    size_t stage_names = 0;
    size_t path = 0;
  };
  // Writes what the client does not know; of the path up to what hangs on the first `keyframes` keyframes, which the
  // client knows.
  void write(Client& client, StreamWriter& out, int keyframes) const;

  double seconds_of(int64_t stamp_ns) const;  // since the first frame
  size_t path_size() const { return path_.size(); }
  // The root of the map that the newest point of the path is in; none while there is no point.
  KeyframeId current_root(const Map& map) const;
  // The motion from the truth's world to the map's that brings the path and the truth together; nothing before there
  // are enough positions of the same time. Of maps that are not joined only the newest point's counts: the others have
  // worlds of their own.
  std::optional<Rigid3> world_from_truth(const Map& map, const std::vector<ViewerOptions::TruePosition>& truth) const;

 private:
  struct PathPoint {
    int frame = 0;
    int64_t stamp_ns = 0;
    KeyframeId host = kNoKeyframe;  // none: the path is broken here
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
  };

  struct StagesOfFrame {
    int frame = 0;
    std::vector<std::pair<uint16_t, uint16_t>> times;  // index of the stage's name, 1/50 ms
  };
  void add_stages(const FrameFact& fact);
  void write_stages(Client& client, StreamWriter& out) const;

  std::optional<int64_t> first_stamp_;
  std::vector<std::string> stage_names_;
  std::deque<StagesOfFrame> stages_;
  uint64_t stages_gone_ = 0;
  std::deque<FrameFact> facts_;
  uint64_t facts_gone_ = 0, events_gone_ = 0;
  std::deque<SessionEvent> events_;
  std::vector<PathPoint> path_;
  uint64_t path_generation_ = 1;
  double spacing_ = 0.005;  // [m] between points of the path
  std::optional<FrameFact> last_on_path_;
};

}  // namespace dkb
