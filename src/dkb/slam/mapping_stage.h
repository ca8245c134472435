// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <thread>

#include "dkb/mapping/local_mapper.h"
#include "dkb/util/bounded_queue.h"

namespace dkb {

// Runs the mapper beside tracking. What becomes of keyframe k is visible at a fixed later frame (logical time), so
// results do not depend on how fast either thread is. Without a thread the same work is done inside push().
class MappingStage {
 public:
  MappingStage(LocalMapper mapper, bool threaded);
  ~MappingStage();  // drains and joins
  MappingStage(const MappingStage&) = delete;
  MappingStage& operator=(const MappingStage&) = delete;

  // Packets and corrections are worked in as they are pushed, one after the other. Due times must not fall.
  void push(KeyframePacket packet, FrameIndex due);
  void push(std::shared_ptr<const MapCorrection> correction, FrameIndex due);
  // The newest view due at `now`, if any. Waits for what is due when `wait`; else takes only what is ready.
  std::optional<MapView> take_due(FrameIndex now, bool wait);
  // Keyframes and corrections pushed whose result was not taken.
  size_t outstanding() const { return due_.size(); }
  // Corrections among them: those that the view taken last does not hold.
  size_t outstanding_corrections() const;
  // Waits for all outstanding work.
  std::optional<MapView> drain();
  // Ends the thread; the mapper may be looked at afterwards.
  void stop();
  const LocalMapper& mapper() const { return mapper_; }  // only after stop(), or without a thread

 private:
  struct Task {  // one of the two
    KeyframePacket packet;
    std::shared_ptr<const MapCorrection> correction;
  };
  struct Due {
    FrameIndex frame = 0;
    bool correction = false;
  };
  void push(Task task, Due due);
  MapView work(const Task& task);

  LocalMapper mapper_;
  BoundedQueue<Task> tasks_;
  BoundedQueue<MapView> views_;
  std::deque<Due> due_;  // of outstanding tasks, in order
  std::thread thread_;
};

}  // namespace dkb
