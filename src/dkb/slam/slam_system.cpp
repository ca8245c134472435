// SPDX-License-Identifier: Apache-2.0
// The library's front door; what happens to a frame stands in slam_pipeline.cpp.
#include "dkb/slam/slam_system.h"

#include <algorithm>

#include "dkb/slam/slam_system_impl.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Maps are numbered by the age of their roots. A root that is not among them is newer than all.
int rank_of(const std::vector<KeyframeId>& roots, KeyframeId root) {
  return static_cast<int>(std::lower_bound(roots.begin(), roots.end(), root) - roots.begin());
}

}  // namespace

const char* name_of(FeatureState state) {
  switch (state) {
    case FeatureState::used:
      return "used";
    case FeatureState::outlier:
      return "outlier";
    case FeatureState::dynamic:
      return "dynamic";
    case FeatureState::unused:
      break;
  }
  return "unused";
}

SlamSystem::SlamSystem(const CameraModel& camera, const SlamOptions& options, DetectorSet detectors)
    : impl_(std::make_unique<Impl>(camera, options, std::move(detectors))) {}
SlamSystem::~SlamSystem() = default;

FrameResult SlamSystem::process(std::shared_ptr<const RgbdImage> image) {
  return impl_->process(std::move(image));
}

FrameResult SlamSystem::process(double timestamp, const uint8_t* colour, int channels, const uint16_t* depth) {
  if (channels != 1 && channels != 3) throw InputError("frame: colour images have 1 or 3 channels");
  const CameraModel& camera = impl_->camera_;
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = image->depth_timestamp = timestamp;
  image->depth = DepthImage(camera.width, camera.height);
  const size_t pixels = image->depth.size();
  if (channels == 3) {
    image->colour = ColourImage(camera.width, camera.height);
    for (size_t i = 0; i < pixels; ++i) image->colour.data()[i] = {colour[3 * i], colour[3 * i + 1], colour[3 * i + 2]};
    image->grey = grey_from_colour(image->colour);
  } else {
    image->grey = GreyImage(camera.width, camera.height);
    std::copy(colour, colour + pixels, image->grey.data());
  }
  const float metres = static_cast<float>(1.0 / camera.depth_factor);
  for (size_t i = 0; i < pixels; ++i) image->depth.data()[i] = metres * static_cast<float>(depth[i]);
  return impl_->process(std::move(image));
}

void SlamSystem::finish() {
  impl_->finish();
}
void SlamSystem::reset() {
  impl_->start();
}
void SlamSystem::load(Map map) {
  impl_->start(std::move(map));
}
void SlamSystem::explain_keyframes(bool on) {
  impl_->explain_keyframes_ = on;
}

void SlamSystem::set_localise_only(bool on) {
  impl_->localise_only_ = on;
}

std::vector<TrajectoryFrame> SlamSystem::trajectory() const {
  const std::vector<KeyframeId> roots = impl_->tracker_->view().roots();
  std::vector<TrajectoryFrame> result;
  for (const auto& r : impl_->records_)
    result.push_back({r.frame, r.timestamp,
                      (r.cam_from_reference * impl_->tracker_->keyframe_pose(r.reference)).inverse(),
                      rank_of(roots, impl_->tracker_->root(r.reference))});
  return result;
}

std::vector<TrajectoryFrame> SlamSystem::online_trajectory() const {
  const std::vector<KeyframeId> roots = impl_->tracker_->view().roots();
  std::vector<TrajectoryFrame> result;
  for (const auto& r : impl_->records_)
    result.push_back(
        {r.frame, r.timestamp, r.world_from_cam_online, rank_of(roots, impl_->tracker_->root(r.reference))});
  return result;
}

std::vector<TrajectoryFrame> SlamSystem::keyframes() const {
  std::vector<TrajectoryFrame> result;
  const Map& map = impl_->tracker_->view();
  const std::vector<KeyframeId> roots = map.roots();
  for (KeyframeId id : map.live_keyframes()) {
    const Keyframe& k = *map.keyframe(id);
    result.push_back({k.frame, k.timestamp, k.cam_from_world.inverse(), rank_of(roots, map.root(id))});
  }
  return result;
}

MapView SlamSystem::map() const {
  return impl_->tracker_->shared_view();
}
const std::vector<FeatureReport>& SlamSystem::features() const {
  return impl_->feature_reports_;
}
const MoverMask& SlamSystem::mover_mask() const {
  return impl_->scene_.mask;
}
const std::vector<Detection>& SlamSystem::detections() const {
  return impl_->scene_.boxes;
}
std::optional<std::string> SlamSystem::take_warning() {
  return impl_->dynamics_.take_warning();
}
const CameraModel& SlamSystem::camera() const {
  return impl_->camera_;
}
const SlamOptions& SlamSystem::options() const {
  return impl_->options_;
}

SlamStatistics SlamSystem::statistics() const {
  SlamStatistics s = impl_->statistics_;
  const Map& map = impl_->tracker_->view();
  s.keyframes = map.live_keyframe_count();
  s.maps = static_cast<int>(map.roots().size());
  s.map_points = map.point_count();
  s.detector = impl_->dynamics_.detector_kind();
  s.detector_rate_hz = impl_->dynamics_.detector_rate_hz();
  s.detector_latency_frames = impl_->dynamics_.detector_latency();
  s.loops = impl_->loop_->loops();
  s.merges = impl_->loop_->merges();
  StageTimes times = impl_->times_;
  times.merge(impl_->loop_->times());
  times.merge(impl_->dynamics_.times());
  times.merge(impl_->dynamics_.detector_times());
  if (impl_->mapping_->outstanding() == 0) {  // the mapper is idle, nothing writes what we read
    s.mapping = impl_->mapping_->mapper().report();
    times.merge(impl_->mapping_->mapper().times());
  }
  s.stages = times.summaries();
  return s;
}

}  // namespace dkb
