// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "dkb/mapping/local_mapper.h"
#include "dkb/util/due_stage.h"
#include "dkb/util/timing.h"

namespace dkb {

// Runs the mapper beside tracking. What becomes of keyframe k is visible at a fixed later frame (logical time), so
// results do not depend on how fast either thread is. Without a thread the same work is done inside push().
class MappingStage {
 public:
  MappingStage(LocalMapper mapper, bool threaded);

  // Packets and corrections are worked in as they are pushed, one after the other. Due times must not fall.
  void push(KeyframePacket packet, FrameIndex due);
  void push(std::shared_ptr<const MapCorrection> correction, FrameIndex due);
  // The newest view due at `now`, if any. Waits for what is due when `wait`; else takes only what is ready.
  std::optional<MapView> take_due(FrameIndex now, bool wait);
  // Keyframes and corrections pushed that the mapper has not come to the end of.
  size_t unfinished() const { return stage_.unfinished(); }
  // Keyframes and corrections pushed whose result was not taken.
  size_t outstanding() const { return stage_.outstanding(); }
  // Corrections among them: those that the view taken last does not hold.
  size_t outstanding_corrections() const { return corrections_; }
  // Waits for all outstanding work.
  std::optional<MapView> drain();
  // What the mapper did, up to the view taken last.
  const MappingReport& report() const { return report_; }
  // Its stages' durations since they were taken last, likewise.
  StageTimes take_times() { return times_.take(); }

 private:
  struct Task {  // one of the two
    KeyframePacket packet;
    std::shared_ptr<const MapCorrection> correction;
  };
  struct Result {
    MapView view;
    bool of_correction = false;
    MappingReport report;
    StageTimes times;
  };
  Result work(const Task& task);

  LocalMapper mapper_;
  MappingReport report_;
  StageTimes times_;
  size_t corrections_ = 0;        // outstanding ones
  DueStage<Task, Result> stage_;  // last: its thread uses the mapper
};

}  // namespace dkb
