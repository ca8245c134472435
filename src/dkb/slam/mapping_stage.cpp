// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/mapping_stage.h"

#include <limits>
#include <utility>

namespace dkb {

MappingStage::MappingStage(LocalMapper mapper, bool threaded)
    : mapper_(std::move(mapper)),
      stage_([this](const Task& task) { return work(task); }, {.name = "mapping", .threaded = threaded}) {}

MappingStage::Result MappingStage::work(const Task& task) {
  MapView view = task.correction ? mapper_.apply(*task.correction) : mapper_.process(task.packet);
  return {std::move(view), task.correction != nullptr, mapper_.report(), mapper_.take_times()};
}

void MappingStage::push(KeyframePacket packet, FrameIndex due) {
  stage_.push({std::move(packet), nullptr}, due);
}

void MappingStage::push(std::shared_ptr<const MapCorrection> correction, FrameIndex due) {
  ++corrections_;
  stage_.push({{}, std::move(correction)}, due);
}

std::optional<MapView> MappingStage::take_due(FrameIndex now, bool wait) {
  std::optional<MapView> newest;
  while (auto result = stage_.take_due(now, wait)) {
    newest = std::move(result->view);
    corrections_ -= result->of_correction ? 1 : 0;
    report_ = result->report;
    times_.merge(result->times);
  }
  return newest;
}

std::optional<MapView> MappingStage::drain() {
  return take_due(std::numeric_limits<FrameIndex>::max(), true);
}

}  // namespace dkb
