// SPDX-License-Identifier: Apache-2.0
// The library's front door; what happens to a frame stands in pipeline.cpp.
#include "dkb_slam/slam.h"

#include <atomic>
#include <exception>
#include <mutex>
#include <utility>

#include "dkb/geometry/decompositions.h"
#include "dkb/image/given_motion.h"
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
    for (const auto& detector : context.detectors.prompt)
      if (detector == nullptr) throw InputError("detectors: one of `prompt` is null; leave it out");
    start({});
  }

  // One feeding call at a time. What the owner of a turn throws ends it.
  class Turn {
   public:
    explicit Turn(Impl& impl) : busy_(impl.busy) {
      if (busy_.exchange(true, std::memory_order_acquire))
        throw InputError(
            "slam: it is at work for another call; feed it from one thread, and not from within a detector or a "
            "keyframe rule");
    }
    ~Turn() { busy_.store(false, std::memory_order_release); }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    std::atomic<bool>& busy_;
  };

  void throw_failure() const {
    if (failure) std::rethrow_exception(failure);
  }
  std::function<DenseMap()> dense_map_task(std::optional<int> map) {
    const Turn turn(*this);
    throw_failure();
    return pipeline->dense_map_task(map);
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

  // With the events of the frame.
  FrameResult process(const Frame& given, std::vector<Event>& told) {
    const Turn turn(*this);
    if (paused) {
      skipped.skip(given);
      if (pipeline) pipeline->pass_over();
      FrameResult result;
      result.frame = last_frame;
      result.stamp_ns = given.stamp_ns();
      result.state = TrackingState::paused;
      return result;
    }
    const Frame frame = skipped.with_motion(given);
    throw_failure();
    pipeline->check(frame);
    FrameResult result = guarded([&] { return pipeline->process(frame); });
    skipped = {};
    last_frame = result.frame;
    told = pipeline->take_events();
    return result;
  }
  std::vector<Event> finish() {
    const Turn turn(*this);
    guarded([&] { pipeline->finish(); });
    return pipeline->take_events();
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
  std::atomic<bool> busy = false;
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
  std::vector<Event> events;
  FrameResult result = impl_->process(given, events);
  impl_->events.deliver(std::move(events));  // out of turn: who is called may call
  return result;
}

void Slam::finish() {
  impl_->events.deliver(impl_->finish());
}

void Slam::reset() {
  const Impl::Turn turn(*impl_);
  impl_->start({});
}
void Slam::pause(bool on) {
  const Impl::Turn turn(*impl_);
  impl_->paused = on;
}
void Slam::localize_only(bool on) {
  const Impl::Turn turn(*impl_);
  impl_->localize_only = on;
  if (impl_->pipeline) impl_->pipeline->localize_only(on);
}
void Slam::suggest_pose(const Rigid3& world_from_cam, const Matrix6d& covariance) {
  if (!is_rigid(world_from_cam, kGivenNorm))
    throw InputError("suggested pose: it is no rigid motion of finite numbers; give a unit quaternion");
  if (!covariance.allFinite() || !is_symmetric(covariance) || !(spectrum(covariance).values[0] > 0))
    throw InputError("suggested pose: its covariance is not symmetric and positive definite; give variances above 0");
  const Impl::Turn turn(*impl_);
  if (!impl_->pipeline) return;
  // The place is sought in the map, which a real-time run may be about to be given.
  if (!impl_->failure) impl_->guarded([&] { impl_->pipeline->catch_up(); });
  impl_->pipeline->suggest_pose({world_from_cam.inverse(), covariance});
}
void Slam::explain_keyframes(bool on) {
  const Impl::Turn turn(*impl_);
  impl_->explain_keyframes = on;
  if (impl_->pipeline) impl_->pipeline->explain_keyframes(on);
}

void Slam::save_map(const std::filesystem::path& path) const {
  save_map_task()(path);
}
std::function<void(const std::filesystem::path&)> Slam::save_map_task() const {
  const Impl::Turn turn(*impl_);
  // After a failure the map as it was then may be saved; where no world could begin there is none.
  if (!impl_->pipeline) impl_->throw_failure();
  if (!impl_->failure) impl_->guarded([&] { impl_->pipeline->catch_up(); });
  return [map = impl_->shared_record()->map(), context = impl_->map_context()](const std::filesystem::path& path) {
    if (path.empty()) throw InputError("save_map: the path is empty; give the name of a file, as map.dkb");
    if (map.keyframe_count() == 0)
      throw InputError(path.string() +
                       ": not written, since the map has no keyframe yet; save it when frames have been tracked");
    dkb::save_map(path, *map.map(), context);
  };
}

void Slam::load_map(const std::filesystem::path& path) {
  const Impl::Turn turn(*impl_);
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
DenseMap Slam::dense_map(int map) const {
  return impl_->dense_map_task(map)();
}
std::function<DenseMap()> Slam::dense_map_task() const {
  return impl_->dense_map_task({});
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
