// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/tracking/frame.h"
#include "dkb/tracking/tracking_map.h"
#include "dkb/util/timing.h"
#include "dkb_slam/slam.h"

namespace dkb {

// Which poses of the frames: as they were published; hanging on the keyframes, since the world may still move; or
// those, smoothed by each other.
enum class TrajectoryKind { online, by_map, smoothed };

// What a run has brought so far. The pipeline writes on its thread; any thread reads.
class RunRecord {
 public:
  void add(const TrackedFrame& frame, const FrameResult& result);
  void add(const KeyframeTests& tests);
  void add(KeyframeRule rule);  // that made a keyframe
  void add(const LoopInfo& loop);
  void set_map(const TrackingMap& map);  // by which frames have their poses from now on
  void add_time(const std::string& stage, double ms);
  // What the stages beside tracking have counted by now, and the durations since they were asked last.
  void add_stages(const std::function<void(Statistics&)>& fill, const StageTimes& times);

  // The durations that came since they were asked for last, by stage.
  std::vector<StageTime> take_news();

  MapSnapshot map() const;
  std::vector<TrajectoryFrame> trajectory(TrajectoryKind kind) const;
  std::vector<TrajectoryFrame> keyframes() const;
  Statistics statistics() const;

 private:
  struct Record {
    FrameIndex frame = 0;
    int64_t stamp_ns = 0;
    KeyframeId reference = kNoKeyframe;
    Rigid3 cam_from_reference, world_from_cam_online;
    Eigen::Matrix<float, 6, 6> covariance;  // as in TrackedFrame
  };
  // Grows without ever being copied as a whole: readers share the blocks that are full.
  class Records {
   public:
    void add(const Record& record);
    size_t size() const;
    template <class Use>
    void for_each(const Use& use) const {
      for (const auto& block : full_)
        for (const Record& r : *block) use(r);
      for (const Record& r : last_) use(r);
    }

   private:
    std::vector<std::shared_ptr<const std::vector<Record>>> full_;
    std::vector<Record> last_;
  };
  mutable std::mutex mutex_;  // guards what follows
  Records records_;
  std::vector<LoopInfo> loops_;
  TrackingMap map_;
  Statistics counts_;
  KeyframeTestCounts tests_;
  StageTimes times_;
  std::map<std::string, double> news_;  // [ms] by stage
};

}  // namespace dkb
