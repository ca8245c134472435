// SPDX-License-Identifier: Apache-2.0
// What the core does beside tracking: map, path, grid and diagnostics.
#include <sys/resource.h>
#include <unistd.h>

#include <future>
#include <utility>

#include "outputs.h"
#include "slam_core.h"

namespace dkb_ros {
namespace {

constexpr int64_t kSilence = 2'000'000'000;  // [ns] without images, or without a pair, that are an error

std::chrono::steady_clock::time_point in_seconds(double s) {
  return std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

std::string seconds(int64_t from_ns, int64_t to_ns) {
  return number(1e-9 * static_cast<double>(to_ns - from_ns)) + " s";
}

// Images come, but no pairs: why, for people. Empty: there are pairs, or no images.
std::string why_no_pairs(const Arrivals& a, int64_t now_ns, int64_t unpaired, int64_t late) {
  if (now_ns - std::max(a.colour, a.depth) > kSilence) return "";
  if (now_ns - (a.pair == 0 ? a.first : a.pair) <= kSilence) return "";
  for (const auto& [name, last_ns] : {std::pair("colour", a.colour), std::pair("depth", a.depth)}) {
    if (last_ns == 0) return std::string("no ") + name + " image has come";
    if (now_ns - last_ns > kSilence) return std::string("no ") + name + " image for " + seconds(last_ns, now_ns);
  }
  return "images come, but none within sync_tolerance (" + std::to_string(unpaired) + " unpaired, " +
         std::to_string(late) + " late)";
}

}  // namespace

void SlamCore::run_reports() {
  auto diagnostics_due = in_seconds(1), map_due = in_seconds(parameters_.map_period);
  int64_t published_ns = 0;
  std::string said;  // the last failure
  std::unique_lock lock(report_mutex_);
  while (true) {
    const auto due = parameters_.map_period > 0 ? std::min(diagnostics_due, map_due) : diagnostics_due;
    if (report_due_.wait_until(lock, due, [this] { return stopping_; })) return;
    const auto now = std::chrono::steady_clock::now();
    const std::shared_ptr<const dkb::Slam> slam = slam_;
    const int64_t stamp_ns = last_result_stamp_ns_;
    lock.unlock();
    const bool map_is_due = parameters_.map_period > 0 && now >= map_due;
    try {
      if (now >= diagnostics_due) publish_diagnostics(slam.get());
      if (map_is_due && slam && stamp_ns != published_ns) publish_map(*slam, stamp_ns);
    } catch (const std::exception& error) {  // the middleware's, or memory is full; the next ones may succeed
      if (std::exchange(said, error.what()) != error.what()) middleware_.log(LogLevel::error, error.what());
    }
    if (now >= diagnostics_due) diagnostics_due = in_seconds(1);
    if (map_is_due) {
      published_ns = stamp_ns;
      map_due = in_seconds(parameters_.map_period);
    }
    lock.lock();
  }
}

void SlamCore::publish_map(const dkb::Slam& slam, int64_t stamp_ns) {
  if (middleware_.wanted(Topic::map_points)) {
    CloudOutput cloud = cloud_of(slam.map().points());
    cloud.stamp_ns = stamp_ns;
    cloud.frame_id = parameters_.map_frame;
    middleware_.publish(cloud);
  }
  if (middleware_.wanted(Topic::path)) {
    // The trajectory first: where maps are joined meanwhile, a part is missing rather than one of another world in it.
    const std::vector<dkb::TrajectoryFrame> trajectory = slam.trajectory();
    middleware_.publish(PathOutput{stamp_ns, parameters_.map_frame,
                                   path_of(trajectory, slam.options().base_from_cam.inverse(), parameters_.path_step,
                                           loaded_maps(slam.keyframes()))});
  }
}

// The grid takes seconds: made beside tracking, at a low priority, from what tracking hands over between two frames.
void SlamCore::run_grids() {
#ifdef __linux__
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 10);
#endif
  std::string said;  // why there is no grid
  std::unique_lock lock(report_mutex_);
  while (!report_due_.wait_until(lock, in_seconds(parameters_.grid_period), [this] { return stopping_; })) {
    const bool started = slam_ != nullptr;
    lock.unlock();
    if (started && middleware_.wanted(Topic::grid)) {
      std::promise<Answer> answered;
      std::function<dkb::DenseMap()> make_dense_map;
      int64_t stamp_ns = 0;
      bool beside_loaded = false;
      request(
          [&](dkb::Slam& slam) {
            // The dense map is of the world of the last pose.
            beside_loaded = loaded_maps_ > 0 && last_map_.value_or(0) >= loaded_maps_;
            if (beside_loaded) return Answer{true, ""};
            make_dense_map = slam.dense_map_task();
            stamp_ns = last_stamp_ns_.value_or(0);
            return Answer{true, ""};
          },
          [&](const Answer& answer) { answered.set_value(answer); });
      answered.get_future().wait();
      const auto tell = [&](const std::string& why) {
        if (std::exchange(said, why) != why) middleware_.log(LogLevel::warning, "no grid: " + why);
      };
      if (beside_loaded) tell("the map that was begun beside the loaded one has no place in it yet");
      if (make_dense_map) try {
          const dkb::DenseMap dense = make_dense_map();
          if (dense.grid) {
            GridOutput grid = grid_in_map(*dense.grid);
            grid.stamp_ns = stamp_ns;
            grid.frame_id = parameters_.map_frame;
            middleware_.publish(grid);
          } else {
            const std::string why = dense.views > 0             ? "the floor has not been seen"
                                    : parameters_.localize_only ? "localize_only makes no keyframes"
                                                                : "no keyframes yet";
            tell(why);
          }
        } catch (const std::exception& error) {
          middleware_.log(LogLevel::warning, error.what());
        }
    }
    lock.lock();
  }
}

void SlamCore::publish_diagnostics(const dkb::Slam* slam) {
  int64_t unpaired = 0, late = 0, late_motion = 0, dropped = 0, outdated = 0;
  Arrivals arrivals;
  {
    const std::lock_guard lock(input_mutex_);
    unpaired = pairing_.unpaired();
    late = pairing_.late();
    late_motion = late_motion_;
    dropped = dropped_;
    outdated = outdated_;
    arrivals = arrivals_;
  }
  const int maps = slam == nullptr ? 0 : slam->statistics().maps;
  const int loaded = maps > 1 ? loaded_maps(slam->keyframes()) : 0;
  std::unique_lock lock(report_mutex_);
  const int64_t newly_dropped = dropped - reported_dropped_;
  reported_dropped_ = dropped;
  const int64_t now_ns = steady_ns();
  using Level = DiagnosticsOutput::Level;
  DiagnosticsOutput d;
  d.stamp_ns = middleware_.now_ns();
  const auto say = [&](Level level, const std::string& message) {
    if (level <= d.level && !d.message.empty()) return;
    d.level = level;
    d.message = message;
  };
  const int64_t last_image_ns = std::max(arrivals.colour, arrivals.depth);
  if (last_image_ns == 0)
    say(Level::error, "no images have come");
  else if (now_ns - last_image_ns > kSilence)
    say(Level::error, "no images for " + seconds(last_image_ns, now_ns));
  const std::string unpairable = why_no_pairs(arrivals, now_ns, unpaired, late);
  if (!unpairable.empty()) say(Level::error, unpairable);
  if (!trouble_.empty()) say(slam == nullptr ? Level::warning : Level::error, trouble_);
  if (slam != nullptr && !hindrance_.empty()) say(Level::warning, hindrance_);
  if (newly_dropped > 0) say(Level::warning, std::to_string(newly_dropped) + " frames dropped: too slow");
  if (maps > std::max(1, loaded))
    say(Level::warning, std::to_string(maps) + " maps that are not joined: " +
                            (loaded > 0 ? "there is no pose in the newest until it is joined to what was loaded"
                                        : "poses are in the newest"));
  if (d.message.empty()) d.message = dkb::name_of(state_);
  const auto add = [&](const std::string& key, const std::string& value) { d.values.emplace_back(key, value); };
  const auto count = [&](const std::string& key, int64_t value) { add(key, std::to_string(value)); };
  add("state", slam == nullptr ? "waiting" : dkb::name_of(state_));
  count("frames", counts_.frames);
  count("tracked", counts_.tracked);
  count("predicted", counts_.predicted);
  count("lost", counts_.lost);
  count("ambiguous", counts_.ambiguous);
  count("paused", counts_.paused);
  count("dropped", dropped + outdated);
  count("unpaired", unpaired);
  count("late", late);
  count("late odometry", late_motion);
  count("rejected", counts_.rejected);
  count("waiting", counts_.waiting);
  count("with prior", counts_.priors);
  count("maps", maps);
  count("rate [1/s]", recent_.frames);
  const auto series = [&](const std::string& name, const Series& s) {
    add(name + " mean [ms]", number(s.count == 0 ? 0 : s.sum / static_cast<double>(s.count)));
    add(name + " max [ms]", number(s.max));
  };
  series("skew", recent_.skew_ms);
  series("tracking", recent_.tracking_ms);
  series("latency", recent_.latency_ms);
  series("overhead", recent_.overhead_ms);
  recent_ = {};
  lock.unlock();
  if (!unpairable.empty()) complain(LogLevel::error, unpairable);
  middleware_.publish(d);
}

}  // namespace dkb_ros
