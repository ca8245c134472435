// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "dkb/loop/global_adjustment.h"
#include "dkb/loop/loop_closer.h"
#include "dkb/slam/frame_rate.h"
#include "dkb/util/due_stage.h"
#include "dkb/util/timing.h"

namespace dkb {

// When background results become visible: so many seconds after they were asked for, in whole frames.
struct BackgroundLatency {
  double base = 0;          // [s] > 0
  double per_keyframe = 0;  // [s] >= 0, times the keyframes that are looked at
  double operator()(int keyframes) const { return base + per_keyframe * keyframes; }
};

struct LoopStageOptions {
  LoopOptions loop;
  BackgroundLatency loop_latency{1.0 / 3, 0.0002};
  BackgroundLatency global_ba_latency{0.5, 0.4 / 30};  // of the keyframes that an adjustment takes, 45 neighbours each
};

// Loop closing and global bundle adjustment beside tracking and mapping, each on its own thread. Both work on views
// that tracking has taken, so that what they see is a matter of logical time. Their corrections go to mapping, the only
// writer. A correction is dropped when the map was moved by another one since its view was made: the loop is found
// again, and the adjustment is made anew.
class LoopStage {
 public:
  LoopStage(const Optics& optics, const LoopStageOptions& options, const LocalBaOptions& local_ba, uint64_t seed,
            bool threaded);

  // `view` as tracking took it at `now`; it must hold all corrections handed out so far. Keyframes that are new in it
  // are searched for loops. `may_skip`: leave keyframes out while the search is late (real-time runs).
  void offer(const MapView& view, FrameIndex now, const FrameRate& rate, bool may_skip);
  // Keyframes below `first` are not searched: they were there before.
  void start_at(KeyframeId first) { next_ = first; }
  // Has all maps adjusted with the next view that is offered.
  void want_adjustment() {
    adjustment_wanted_ = true;
    adjust_around_.clear();
  }

  // Corrections due at `now`, in the order in which mapping must take them. A loop is closed at once; a merge may wait
  // or not be made at all.
  std::vector<std::shared_ptr<const MapCorrection>> take_due(FrameIndex now, bool wait);
  // The maps were joined by a merge that was handed out.
  void merged(const MapCorrection& merge);
  bool idle() const {
    return search_.outstanding() == 0 && adjustment_.outstanding() == 0 && !adjustment_wanted_ && again_.empty();
  }
  // Durations of loop and global_ba since they were taken last, of the results that were taken.
  StageTimes take_times() { return times_.take(); }

 private:
  struct Task {
    MapView view;
    std::vector<KeyframeId> keyframes;  // the one that is searched, or those adjusted around
    int generation = 0;                 // of an adjustment: moves by then
  };
  struct Result {
    std::shared_ptr<const MapCorrection> correction;  // none when nothing was found
    int generation = 0;                               // of the task
    KeyframeId skipped = kNoKeyframe;                 // to be searched when the loop found before it has moved the map
    std::optional<double> ms;                         // of a search that was made
  };

  void moved_by(const MapCorrection& correction);

  LoopStageOptions options_;
  LoopCloser closer_;              // of the search's thread
  int closed_generation_ = -1;     // likewise: where it found the last loop
  int generation_ = 0;             // loops and merges handed out, and merges made
  int void_below_ = 0;             // generation: what is found on views from before a merge was made is of no use
  int moves_ = 0;                  // of the map, by loops and merges
  KeyframeId next_ = 0;            // the first keyframe that was not offered yet
  std::vector<KeyframeId> again_;  // those before it that were skipped, increasing
  bool adjustment_wanted_ = false, adjustment_overtaken_ = false;
  std::vector<KeyframeId> adjust_around_;  // where the loops since the last adjustment were; none: everywhere
  StageTimes times_;
  DueStage<Task, Result> search_, adjustment_;  // last: their threads use the above
};

}  // namespace dkb
