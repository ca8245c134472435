// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/mapping_stage.h"

#include <algorithm>
#include <limits>

namespace dkb {
namespace {
// More than can ever be outstanding: tracking waits for each keyframe at its due time, or holds back new ones.
constexpr size_t kSlots = 1024;
}  // namespace

MappingStage::MappingStage(LocalMapper mapper, bool threaded)
    : mapper_(std::move(mapper)), tasks_(kSlots), views_(kSlots) {
  if (threaded)
    thread_ = std::thread([this] {
      while (auto task = tasks_.pop()) views_.push(work(*task));
    });
}

MappingStage::~MappingStage() {
  stop();
}

MapView MappingStage::work(const Task& task) {
  return task.correction ? mapper_.apply(*task.correction) : mapper_.process(task.packet);
}

void MappingStage::push(Task task, Due due) {
  due_.push_back(due);
  if (thread_.joinable())
    tasks_.push(std::move(task));
  else
    views_.push(work(task));
}

void MappingStage::push(KeyframePacket packet, FrameIndex due) {
  push(Task{std::move(packet), nullptr}, Due{due, false});
}

void MappingStage::push(std::shared_ptr<const MapCorrection> correction, FrameIndex due) {
  push(Task{{}, std::move(correction)}, Due{due, true});
}

std::optional<MapView> MappingStage::take_due(FrameIndex now, bool wait) {
  std::optional<MapView> newest;
  while (!due_.empty() && due_.front().frame <= now) {
    std::optional<MapView> view = wait ? views_.pop() : views_.try_pop();
    if (!view) break;
    newest = std::move(view);
    due_.pop_front();
  }
  return newest;
}

size_t MappingStage::outstanding_corrections() const {
  return static_cast<size_t>(std::count_if(due_.begin(), due_.end(), [](const Due& d) { return d.correction; }));
}

std::optional<MapView> MappingStage::drain() {
  return take_due(std::numeric_limits<FrameIndex>::max(), true);
}

void MappingStage::stop() {
  tasks_.close();
  if (thread_.joinable()) thread_.join();
}

}  // namespace dkb
