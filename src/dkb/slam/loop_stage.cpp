// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/loop_stage.h"

#include <algorithm>
#include <utility>

namespace dkb {
namespace {

constexpr size_t kMaxLate = 4;                 // searches that wait in a real-time run
constexpr size_t kNeighboursOfAKeyframe = 45;  // covisible ones, of those that the latency of an adjustment is told for

// The keyframes of so many neighbours whose adjustment takes as long as this map's, which takes part of a large one.
int adjusted_keyframes(const Map& map) {
  size_t neighbours = 0;
  for (KeyframeId k : map.live_keyframes()) neighbours += map.keyframe(k)->covisible.size();
  return static_cast<int>(std::min(neighbours, kMostNeighbours) / kNeighboursOfAKeyframe);
}

}  // namespace

LoopStage::LoopStage(const Optics& optics, const LoopStageOptions& options, const LocalBaOptions& local_ba,
                     uint64_t seed, bool threaded)
    : options_(options),
      closer_(optics, options.loop, seed),
      search_(
          [this](const Task& task) {
            Result result;
            result.generation = task.generation;
            const KeyframeId keyframe = task.keyframes.front();
            if (task.generation == closed_generation_) {  // the map is about to move
              if (!closer_.rests(keyframe)) result.skipped = keyframe;
              return result;
            }
            const Stopwatch watch;
            if (auto correction = closer_.process(*task.view, keyframe)) {
              result.correction = std::make_shared<const MapCorrection>(std::move(*correction));
              closed_generation_ = task.generation;
            }
            result.ms = watch.ms();
            return result;
          },
          {.name = "loop search", .threaded = threaded, .priority = ThreadPriority::background}),
      adjustment_(
          [optics, local_ba](const Task& task) {
            const Stopwatch watch;
            Result result;
            result.generation = task.generation;
            result.correction =
                std::make_shared<const MapCorrection>(adjust_globally(*task.view, optics, local_ba, task.keyframes));
            result.ms = watch.ms();
            return result;
          },
          {.name = "global bundle adjustment", .threaded = threaded, .priority = ThreadPriority::background}) {}

void LoopStage::offer(const MapView& view, FrameIndex now, const FrameRate& rate, bool may_skip) {
  const int keyframes = view->live_keyframe_count();
  // An adjustment that a loop overtook is not made anew in vain: the searches wait for it.
  std::vector<KeyframeId> due;
  if (!adjustment_overtaken_) {
    due = std::exchange(again_, {});
    while (next_ < view->keyframe_count()) due.push_back(next_++);
  }
  for (size_t i = 0; i < due.size(); ++i) {
    if (!options_.loop.enabled || view->live_keyframe(due[i]) == nullptr) continue;
    // The newest ones are searched: what they show is where the camera is.
    if (may_skip && search_.unfinished() + due.size() - i > kMaxLate) continue;
    search_.push({view, {due[i]}, generation_}, now + rate.frames(options_.loop_latency(keyframes)));
  }
  const bool may_be_overtaken = adjustment_overtaken_ && search_.outstanding() > 0;
  if (adjustment_wanted_ && adjustment_.outstanding() == 0 && !may_be_overtaken) {
    adjustment_.push({view, adjust_around_, moves_},
                     now + rate.frames(options_.global_ba_latency(adjusted_keyframes(*view))));
    adjustment_wanted_ = false;
  }
}

void LoopStage::moved_by(const MapCorrection& correction) {
  ++moves_;
  adjustment_wanted_ = true;
  adjust_around_.push_back(correction.near_side.front());
}

void LoopStage::merged(const MapCorrection& merge) {
  void_below_ = ++generation_;
  moved_by(merge);
}

std::vector<std::shared_ptr<const MapCorrection>> LoopStage::take_due(FrameIndex now, bool wait) {
  std::vector<std::shared_ptr<const MapCorrection>> corrections;
  while (auto found = search_.take_due(now, wait)) {
    if (found->skipped != kNoKeyframe) again_.push_back(found->skipped);
    if (found->ms) times_.add("loop", *found->ms);
    if (!found->correction) continue;
    if (found->generation < void_below_) {
      again_.push_back(found->correction->near_side.front());
      continue;
    }
    ++generation_;
    if (found->correction->kind == MapCorrection::Kind::loop) moved_by(*found->correction);
    corrections.push_back(std::move(found->correction));
  }
  while (auto adjusted = adjustment_.take_due(now, wait)) {
    times_.add("global_ba", *adjusted->ms);
    adjustment_overtaken_ = adjusted->generation != moves_;
    if (adjustment_overtaken_) continue;
    adjust_around_.clear();
    corrections.push_back(std::move(adjusted->correction));
  }
  return corrections;
}

}  // namespace dkb
