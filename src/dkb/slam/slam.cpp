// SPDX-License-Identifier: Apache-2.0
// The library's front door; what happens to a frame stands in pipeline.cpp.
#include "dkb_slam/slam.h"

#include <cmath>
#include <exception>
#include <mutex>
#include <utility>

#include "dkb/geometry/decompositions.h"
#include "dkb/image/skipped_motion.h"
#include "dkb/map/map_file.h"
#include "dkb/slam/event_outlet.h"
#include "dkb/slam/pipeline.h"
#include "dkb/util/errors.h"
#include "dkb/util/thrown.h"

namespace dkb {

const char* version() {
  return DKB_SLAM_VERSION;
}

const char* name_of(Event::Kind kind) {
  static constexpr const char* names[] = {"keyframe", "loop", "merge", "lost", "found", "new_map", "warning"};
  return names[static_cast<size_t>(kind)];
}

Detectors Detectors::none() {
  Detectors none;
  none.motion = false;
  return none;
}

void DetectionSchedule::check() const {
  require_option(every >= 1, "detector.every", every, "at least 1 frame");
  require_option(latency >= 0, "detector.latency", latency, "at least 0 frames");
}

class Slam::Impl {
 public:
  Impl(const Camera& camera, const Options& given, Detectors detectors, std::shared_ptr<KeyframePolicy> policy)
      : options(given), context{camera, expand(given), std::move(detectors), std::move(policy)} {
    context.camera.check();
    given.check();
    context.detectors.schedule.check();
    start({});
  }

  void throw_failure() const {
    if (failure) std::rethrow_exception(failure);
  }

  // What `work` throws ends this world: every call throws it until a new one is begun.
  template <class Work>
  auto guarded(const Work& work) {
    throw_failure();
    try {
      return work();
    } catch (...) {
      failure = as_input_error("tracking");
    }
    std::rethrow_exception(failure);
  }

  void start(Map map) {
    failure = nullptr;
    skipped = {};
    last_frame = 0;
    pipeline.reset();
    auto fresh = std::make_shared<RunRecord>();
    {
      const std::lock_guard lock(record_mutex);
      record = fresh;
    }
    // What a detector or a rule throws when it begins anew: there is no world until the next attempt.
    guarded([&] { pipeline = std::make_unique<Pipeline>(context, *fresh, std::move(map)); });
    pipeline->localize_only(localize_only);
    pipeline->explain_keyframes(explain_keyframes);
  }

  MapFileContext map_context() const {
    return {context.camera, context.options.features.scale, context.options.features.levels};
  }

  // The record of this world: readers on other threads keep it for as long as they read.
  std::shared_ptr<const RunRecord> shared_record() const {
    const std::lock_guard lock(record_mutex);
    return record;
  }

  Options options;
  PipelineContext context;
  bool paused = false, localize_only = false, explain_keyframes = false;
  SkippedMotion skipped;
  int last_frame = 0;  // that was accepted
  EventOutlet events;
  std::exception_ptr failure;
  mutable std::mutex record_mutex;
  std::shared_ptr<RunRecord> record;
  std::unique_ptr<Pipeline> pipeline;
};

Slam::Slam(const Camera& camera, const Options& options, Detectors detectors, std::shared_ptr<KeyframePolicy> policy)
    : impl_(std::make_unique<Impl>(camera, options, std::move(detectors), std::move(policy))) {}
Slam::~Slam() = default;
Slam::Slam(Slam&&) noexcept = default;
Slam& Slam::operator=(Slam&&) noexcept = default;

FrameResult Slam::process(const FrameInput& input) {
  return process(Frame(impl_->context.camera, input));
}

FrameResult Slam::process(const Frame& given) {
  if (impl_->paused) {
    impl_->skipped.skip(given);
    FrameResult result;
    result.frame = impl_->last_frame;
    result.stamp_ns = given.stamp_ns();
    result.state = TrackingState::paused;
    return result;
  }
  const Frame frame = impl_->skipped.with_motion(given);
  impl_->throw_failure();
  impl_->pipeline->check(frame);
  FrameResult result = impl_->guarded([&] { return impl_->pipeline->process(frame); });
  impl_->skipped = {};
  impl_->last_frame = result.frame;
  impl_->events.deliver(impl_->pipeline->take_events());
  return result;
}

void Slam::finish() {
  impl_->guarded([&] { impl_->pipeline->finish(); });
  impl_->events.deliver(impl_->pipeline->take_events());
}

void Slam::reset() {
  impl_->start({});
}
void Slam::pause(bool on) {
  impl_->paused = on;
}
void Slam::localize_only(bool on) {
  impl_->localize_only = on;
  if (impl_->pipeline) impl_->pipeline->localize_only(on);
}
void Slam::suggest_pose(const Rigid3& world_from_cam, const Matrix6d& covariance) {
  if (!world_from_cam.translation.allFinite() || !(std::abs(world_from_cam.rotation.norm() - 1) < 1e-3))
    throw InputError("suggested pose: it is no rigid motion of finite numbers; give a unit quaternion");
  if (!covariance.allFinite() || !(spectrum(covariance).values[0] > 0))
    throw InputError("suggested pose: its covariance is not positive definite; give variances above 0");
  if (impl_->pipeline) impl_->pipeline->suggest_pose({world_from_cam.inverse(), covariance});
}
void Slam::explain_keyframes(bool on) {
  impl_->explain_keyframes = on;
  if (impl_->pipeline) impl_->pipeline->explain_keyframes(on);
}

void Slam::save_map(const std::filesystem::path& path) const {
  save_map_task()(path);
}
std::function<void(const std::filesystem::path&)> Slam::save_map_task() const {
  // After a failure the map as it was then may be saved; where no world could begin there is none.
  if (!impl_->pipeline) impl_->throw_failure();
  if (!impl_->failure) impl_->guarded([&] { impl_->pipeline->catch_up(); });
  return [map = impl_->shared_record()->map(), context = impl_->map_context()](const std::filesystem::path& path) {
    dkb::save_map(path, *map.map(), context);
  };
}

void Slam::load_map(const std::filesystem::path& path) {
  MapFile file = dkb::load_map(path);
  check_same_optics(file.context, impl_->map_context(), path.string());
  file.map.date_back();
  impl_->start(std::move(file.map));
}

MapSnapshot Slam::map() const {
  return impl_->shared_record()->map();
}
std::vector<TrajectoryFrame> Slam::trajectory() const {
  return impl_->shared_record()->trajectory(impl_->context.options.smooth_trajectory ? TrajectoryKind::smoothed
                                                                                     : TrajectoryKind::by_map);
}
std::vector<TrajectoryFrame> Slam::online_trajectory() const {
  return impl_->shared_record()->trajectory(TrajectoryKind::online);
}
std::vector<TrajectoryFrame> Slam::keyframes() const {
  return impl_->shared_record()->keyframes();
}
Statistics Slam::statistics() const {
  return impl_->shared_record()->statistics();
}
DenseMap Slam::dense_map() const {
  return dense_map_task()();
}
std::function<DenseMap()> Slam::dense_map_task() const {
  impl_->throw_failure();
  return impl_->pipeline->dense_map_task();
}

std::vector<Event> Slam::take_events() {
  return impl_->events.take();
}
void Slam::on_event(std::function<void(const Event&)> callback, Executor executor) {
  impl_->events.set(std::move(callback), std::move(executor));
}

const Camera& Slam::camera() const {
  return impl_->context.camera;
}
const Options& Slam::options() const {
  return impl_->options;
}

}  // namespace dkb
