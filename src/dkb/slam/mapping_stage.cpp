// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/mapping_stage.h"

#include <limits>

namespace dkb {
namespace {
// More than can ever be outstanding: tracking waits for each keyframe at its due time, or holds back new ones.
constexpr size_t kSlots = 1024;
}  // namespace

MappingStage::MappingStage(LocalMapper mapper, bool threaded)
    : mapper_(std::move(mapper)), packets_(kSlots), views_(kSlots) {
  if (threaded)
    thread_ = std::thread([this] {
      while (auto packet = packets_.pop()) views_.push(mapper_.process(*packet));
    });
}

MappingStage::~MappingStage() {
  stop();
}

void MappingStage::push(KeyframePacket packet, FrameIndex due) {
  due_.push_back(due);
  if (thread_.joinable())
    packets_.push(std::move(packet));
  else
    views_.push(mapper_.process(packet));
}

std::optional<MapView> MappingStage::take_due(FrameIndex now, bool wait) {
  std::optional<MapView> newest;
  while (!due_.empty() && due_.front() <= now) {
    std::optional<MapView> view = wait ? views_.pop() : views_.try_pop();
    if (!view) break;
    newest = std::move(view);
    due_.pop_front();
  }
  return newest;
}

std::optional<MapView> MappingStage::drain() {
  return take_due(std::numeric_limits<FrameIndex>::max(), true);
}

void MappingStage::stop() {
  packets_.close();
  if (thread_.joinable()) thread_.join();
}

}  // namespace dkb
