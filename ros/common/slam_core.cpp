// SPDX-License-Identifier: Apache-2.0
#include "slam_core.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "inputs.h"
#include "outputs.h"

namespace dkb_ros {
namespace {

constexpr int64_t kRepeatAfter = 10'000'000'000;  // [ns] before the same complaint is made again

// Messages that differ in their numbers say the same.
std::string without_digits(std::string text) {
  std::erase_if(text, [](char c) { return c >= '0' && c <= '9'; });
  return text;
}

const char* text_of(bool on) {
  return on ? "on" : "off";
}

}  // namespace

SlamCore::SlamCore(const Parameters& parameters, Middleware& middleware)
    : parameters_(parameters),
      middleware_(middleware),
      pairing_(static_cast<int64_t>(1e9 * parameters.sync_tolerance), static_cast<size_t>(parameters.queue_size)),
      odometry_{dkb::MotionHistory(parameters.prior_drift)} {
  parameters_.options.check();
  if (parameters_.localize_only && parameters_.grid_period > 0)
    middleware_.log(LogLevel::warning,
                    "grid_period: localize_only makes no keyframes, which grids are made of; serve the grid that was "
                    "saved with the map by map_server");
  tracking_ = std::thread([this] { run_tracking(); });
  reports_ = std::thread([this] { run_reports(); });
  if (parameters_.grid_period > 0) grids_ = std::thread([this] { run_grids(); });
}

SlamCore::~SlamCore() {
  {
    const std::scoped_lock lock(input_mutex_, report_mutex_);
    stopping_ = true;
  }
  input_changed_.notify_all();
  report_due_.notify_all();
  tracking_.join();
  reports_.join();
  if (grids_.joinable()) grids_.join();
}

void SlamCore::colour(ImageMessage image) {
  image.arrived_ns = steady_ns();
  const std::lock_guard lock(input_mutex_);
  arrived(&arrivals_.colour, image.arrived_ns);
  enqueue(pairing_.add_colour(std::move(image)));
}

void SlamCore::depth(ImageMessage image) {
  image.arrived_ns = steady_ns();
  const std::lock_guard lock(input_mutex_);
  arrived(&arrivals_.depth, image.arrived_ns);
  enqueue(pairing_.add_depth(std::move(image)));
}

void SlamCore::arrived(int64_t* last, int64_t now_ns) {
  if (arrivals_.first == 0) arrivals_.first = now_ns;
  *last = now_ns;
}

void SlamCore::enqueue(std::vector<ImagePair> pairs) {
  if (!pairs.empty()) arrivals_.pair = std::max(arrivals_.colour, arrivals_.depth);
  for (ImagePair& pair : pairs) {
    if (pairs_.size() == static_cast<size_t>(parameters_.queue_size)) {
      const bool jumped = pairs_.front().clock_jumped;
      pairs_.pop_front();
      ++dropped_;
      if (jumped) (pairs_.empty() ? pair : pairs_.front()).clock_jumped = true;
    }
    pairs_.push_back(std::move(pair));
  }
  if (!pairs_.empty()) input_changed_.notify_one();
}

void SlamCore::camera_info(const CameraInfoMessage& info) {
  const std::lock_guard lock(input_mutex_);
  if (!camera_info_) camera_info_ = info;
}

// The history may refuse a message: that is counted, and told the first time.
template <class Sample>
void SlamCore::add_motion(Motion& motion, const Sample& sample, const std::string& frame, const std::string& what) {
  {
    const std::lock_guard lock(input_mutex_);
    if (motion.history.add(sample)) {
      motion.frame = frame;
      return;
    }
    ++late_motion_;
    if (std::exchange(motion.told, true)) return;
  }
  complain(LogLevel::warning, what + "; /diagnostics counts such as `late odometry`");
}

void SlamCore::odometry(const OdometryMessage& odometry) {
  add_motion(odometry_,
             dkb::OdometrySample{odometry.stamp_ns, odometry.pose, odometry.twist, odometry.pose_covariance.diagonal(),
                                 odometry.twist_covariance.diagonal()},
             odometry.child_frame_id,
             "odom_prior: a message was left out, since its stamp is not after the one before, or its pose is none");
}

void SlamCore::imu(const ImuMessage& imu) {
  add_motion(gyro_, dkb::GyroSample{imu.stamp_ns, imu.angular_velocity, imu.covariance.diagonal()}, imu.frame_id,
             "imu: a message was left out, since its stamp is not after the one before, or it has no angular velocity");
}

void SlamCore::initial_pose(const PoseMessage& pose) {
  request(
      [this, pose](dkb::Slam& slam) {
        const auto map_from_frame = pose.frame_id.empty() || pose.frame_id == parameters_.map_frame
                                        ? Rigid3()
                                        : middleware_.transform(parameters_.map_frame, pose.frame_id, std::nullopt);
        if (!map_from_frame)
          return Answer{false, "initialpose: no transform from " + parameters_.map_frame + " to " + pose.frame_id};
        if (!pose.pose.translation.allFinite() || !(std::abs(pose.pose.rotation.norm() - 1) < 0.01))
          return Answer{false, "initialpose: it is no pose"};
        const Rigid3 base(pose.pose.rotation.normalized(), pose.pose.translation);
        Matrix6d covariance = camera_covariance(pose.covariance, base_from_cam_, base.rotation);
        covariance.diagonal().array() += 1e-4;  // RViz gives none for height, roll and pitch
        slam.suggest_pose(*map_from_frame * base * base_from_cam_, covariance);
        return Answer{true, ""};
      },
      [](const Answer&) {});
}

void SlamCore::request(Task task, Done done) {
  {
    const std::lock_guard lock(input_mutex_);
    if (!stopping_) {
      tasks_.emplace_back(std::move(task), std::move(done));
      input_changed_.notify_one();
      return;
    }
  }
  done({false, "the node is stopping"});
}

void SlamCore::save_map(const std::string& path, Done done) {
  request(
      [path](dkb::Slam& slam) {
        slam.save_map(path);
        return Answer{true, "map written to " + path};
      },
      std::move(done));
}

void SlamCore::load_map(const std::string& path, Done done) {
  request(
      [this, path](dkb::Slam& slam) {
        begin_in(slam, path);
        begin_anew();
        return Answer{true, "going on in " + path};
      },
      std::move(done));
}

void SlamCore::reset(Done done) {
  request(
      [this](dkb::Slam& slam) {
        slam.reset();
        loaded_map_.clear();
        begin_anew();
        return Answer{true, "a new world begins"};
      },
      std::move(done));
}

void SlamCore::pause(bool on, Done done) {
  request(
      [this, on](dkb::Slam& slam) {
        paused_ = on;
        slam.pause(on);
        return Answer{true, std::string("pause is ") + text_of(on)};
      },
      std::move(done));
}

void SlamCore::localize_only(bool on, Done done) {
  request(
      [on](dkb::Slam& slam) {
        slam.localize_only(on);
        return Answer{true, std::string("localize_only is ") + text_of(on)};
      },
      std::move(done));
}

void SlamCore::run_tracking() {
  std::unique_lock lock(input_mutex_);
  while (true) {
    input_changed_.wait(lock, [this] { return stopping_ || !tasks_.empty() || !pairs_.empty(); });
    if (!tasks_.empty()) {
      const auto [task, done] = std::move(tasks_.front());
      tasks_.pop_front();
      const bool stopping = stopping_;
      lock.unlock();
      Answer answer{false, stopping ? "the node is stopping" : "no frame has come yet, so there is no map"};
      if (slam_ && !stopping) try {
          answer = task(*slam_);
        } catch (const std::exception& error) {
          answer = {false, error.what()};
        }
      if (!answer.success) complain(LogLevel::warning, answer.message);
      try {
        done(answer);
      } catch (const std::exception& error) {
        complain(LogLevel::warning, std::string("a service's answer was not sent: ") + error.what());
      }
      lock.lock();
      continue;
    }
    if (stopping_) return;
    const ImagePair pair = std::move(pairs_.front());
    pairs_.pop_front();
    lock.unlock();
    try {
      process(pair);
    } catch (const std::exception& error) {  // the middleware's as well; the node goes on
      complain(LogLevel::error, error.what());
      const std::lock_guard report(report_mutex_);
      ++counts_.rejected;
      trouble_ = error.what();
    }
    lock.lock();
  }
}

void SlamCore::process(const ImagePair& pair) {
  if (pair.clock_jumped) {
    {
      const std::lock_guard lock(input_mutex_);
      odometry_.history.clear();
      gyro_.history.clear();
    }
    begin_after_jump();
  }
  if (!slam_ && !start(pair)) return;
  // While a visitor of the page has paused, the library passes frames over as for the service: it joins their motions,
  // and takes the time until the next frame for no leap of the clock.
  const bool held = viewer_ && !viewer_->wait_turn(std::chrono::milliseconds(0));
  slam_->pause(paused_ || held);
  const dkb::FrameInput input = input_of(pair);
  const dkb::Frame frame(slam_->camera(), input);
  dkb::FrameResult result = slam_->process(frame);
  last_stamp_ns_ = pair.colour.stamp_ns;  // paused too: the motions of frames that were skipped are joined
  publish(pair, result, held ? "paused on the page" : hindrance_of(result));
  std::vector<dkb::Event> events = tell_events();
  if (!viewer_ || held) return;
  viewer_->show(std::move(result), frame, slam_->map(), std::move(events));
  if (slam_->options().dense_map && viewer_->wants_dense_map()) viewer_->show_dense_map(slam_->dense_map_task());
  if (viewer_->take_save_order()) viewer_->say("here the service save_map saves the map");
}

void SlamCore::open_page() {
  dkb::ViewerOptions options;
  options.host = parameters_.viewer_host;
  options.port = parameters_.viewer_port;
  options.description = "ROS node, images in " + camera_frame_;
  options.camera = slam_->camera();
  options.realtime = true;
  if (options.camera.fps > 0) options.budget_ms = 1000 / options.camera.fps;
  try {
    viewer_ = dkb::open_viewer(options);
    slam_->explain_keyframes(true);
    middleware_.log(LogLevel::info, "viewer: " + viewer_->url());
  } catch (const std::exception& error) {
    middleware_.log(LogLevel::error, std::string("viewer_port: ") + error.what());
  }
}

const std::string& SlamCore::camera_frame(const ImagePair& pair) const {
  return parameters_.camera_frame.empty() ? pair.colour.frame_id : parameters_.camera_frame;
}

// Makes the library's system once the camera and its mount are known.
bool SlamCore::start(const ImagePair& pair) {
  const auto wait_for = [this](const std::string& what) {
    complain(LogLevel::warning, what);
    const std::lock_guard lock(report_mutex_);
    ++counts_.waiting;
    trouble_ = what;
    return false;
  };
  const std::optional<dkb::Camera> camera = find_camera();
  if (!camera) return wait_for("waiting for rgb/camera_info; without it, set `camera`");
  const std::string& frame = camera_frame(pair);
  const auto mount = parameters_.base_from_cam ? parameters_.base_from_cam
                                               : middleware_.transform(parameters_.base_frame, frame, std::nullopt);
  if (!mount)
    return wait_for("waiting for the transform from " + parameters_.base_frame + " to " + frame +
                    "; without one, set `base_from_cam`");
  base_from_cam_ = *mount;
  camera_frame_ = frame;
  dkb::Options options = parameters_.options;
  options.base_from_cam = base_from_cam_;
  options.set("experiment.smooth_trajectory", "false");  // the path is sent once a second: by the map is near enough
  // What failed once fails again, after seconds that a network may take.
  if (!failed_start_.empty()) throw dkb::InputError(failed_start_);
  std::shared_ptr<dkb::Slam> slam;
  try {
    slam = make_slam(*camera, options);
  } catch (const std::exception& error) {
    failed_start_ = std::string(error.what()) + "; then start the node anew";
    throw dkb::InputError(failed_start_);
  }
  middleware_.log(LogLevel::info, "started: camera " + std::to_string(camera->width) + " x " +
                                      std::to_string(camera->height) + " in " + frame);
  if (pair.depth.frame_id != pair.colour.frame_id)
    middleware_.log(LogLevel::warning, "depth/image is in frame " + pair.depth.frame_id + ", rgb/image in " +
                                           pair.colour.frame_id + ": taken for registered to the colour image");
  {
    const std::lock_guard lock(report_mutex_);
    slam_ = std::move(slam);
  }
  if (parameters_.viewer_port >= 0) open_page();
  return true;
}

std::shared_ptr<dkb::Slam> SlamCore::make_slam(const dkb::Camera& camera, const dkb::Options& options) {
  auto slam = std::make_shared<dkb::Slam>(camera, options, dkb::make_detectors(parameters_.detector, camera));
  slam->localize_only(parameters_.localize_only);
  if (!parameters_.load_map.empty()) begin_in(*slam, parameters_.load_map);
  return slam;
}

std::optional<dkb::Camera> SlamCore::find_camera() {
  std::optional<dkb::Camera> camera;
  if (!parameters_.camera.empty()) {
    std::error_code unknown;  // of a path that cannot be looked at
    camera = std::filesystem::exists(parameters_.camera, unknown) ? dkb::Camera::load(parameters_.camera)
                                                                  : dkb::Camera::named(parameters_.camera);
  } else {
    const std::lock_guard lock(input_mutex_);
    if (!camera_info_) return std::nullopt;
    const CameraInfoMessage info = *camera_info_;
    camera_info_.reset();  // a wrong one may be followed by a right one
    camera = camera_of(info, parameters_.rectified);
    camera_info_ = info;
  }
  camera->depth_factor = parameters_.depth_factor;
  camera->check();
  return camera;
}

dkb::FrameInput SlamCore::input_of(const ImagePair& pair) {
  dkb::FrameInput input;
  input.stamp_ns = pair.colour.stamp_ns;
  input.colour = view_of(pair.colour, false);
  input.depth = view_of(pair.depth, true);
  input.depth_stamp_ns = pair.depth.stamp_ns;
  if (last_stamp_ns_) input.prior = prior(input.stamp_ns);
  return input;
}

// What wheels or gyroscope say of the motion since the frame before.
std::optional<dkb::MotionPrior> SlamCore::prior(int64_t stamp_ns) {
  const PriorKind kind = parameters_.prior;
  std::optional<dkb::MotionPrior> motion;
  std::string frame;
  {
    const std::lock_guard lock(input_mutex_);
    const auto ask = [&](const Motion& of) {
      motion = of.history.between(*last_stamp_ns_, stamp_ns);
      frame = of.frame;
    };
    if (kind == PriorKind::odom || kind == PriorKind::automatic) ask(odometry_);
    if (!motion && (kind == PriorKind::imu || kind == PriorKind::automatic)) ask(gyro_);
  }
  if (!motion) return std::nullopt;
  const std::optional<Rigid3> cam_from_frame = cam_from(frame);
  if (!cam_from_frame) {
    complain(LogLevel::warning, "no transform from " + camera_frame_ + " to " + frame + ": its motion is not used");
    return std::nullopt;
  }
  const std::lock_guard lock(report_mutex_);
  ++counts_.priors;
  return dkb::moved_to_camera(*motion, *cam_from_frame);
}

std::optional<Rigid3> SlamCore::cam_from(const std::string& frame) {
  if (frame.empty() || frame == parameters_.base_frame) return base_from_cam_.inverse();
  const auto known = cam_from_frame_.find(frame);
  if (known != cam_from_frame_.end()) return known->second;
  const std::optional<Rigid3> found = middleware_.transform(camera_frame_, frame, std::nullopt);
  if (found) cam_from_frame_.emplace(frame, *found);
  return found;
}

// Throws what the library throws, and changes nothing then.
void SlamCore::begin_in(dkb::Slam& slam, const std::string& map) {
  slam.load_map(map);
  loaded_map_ = map;
}

// After a service: the images that follow may have any stamps.
void SlamCore::begin_anew() {
  forget_motion();
  const std::lock_guard lock(input_mutex_);
  outdated_ += static_cast<int64_t>(pairs_.size());
  pairs_.clear();  // of the old world: their stamps would keep out those that follow
  pairing_.restart();
  odometry_.history.clear();
  gyro_.history.clear();
}

// Another recording, or the robot's clock was set: a map that was loaded holds all the same.
void SlamCore::begin_after_jump() {
  const std::string jumped = "the stamps of the images went back by more than a second: ";
  bool loaded = false;
  if (slam_ && !loaded_map_.empty()) {
    try {
      begin_in(*slam_, loaded_map_);
      loaded = true;
    } catch (const std::exception& error) {
      complain(LogLevel::error, error.what());
    }
  }
  if (slam_ && !loaded) slam_->reset();
  complain(LogLevel::warning, jumped + (loaded ? "begins again in " + loaded_map_ : "a new world begins"));
  forget_motion();
}

void SlamCore::forget_motion() {
  last_stamp_ns_.reset();
  last_pose_.reset();
  map_from_odom_.reset();
  last_map_.reset();
  unplaced_.clear();
}

std::vector<dkb::Event> SlamCore::tell_events() {
  std::vector<dkb::Event> events = slam_->take_events();
  for (const dkb::Event& e : events) {
    using Kind = dkb::Event::Kind;
    if (e.kind == Kind::keyframe) continue;
    const bool bad = e.kind == Kind::warning || e.kind == Kind::lost;
    middleware_.log(bad ? LogLevel::warning : LogLevel::info,
                    std::string(dkb::name_of(e.kind)) + (e.text.empty() ? "" : ": " + e.text));
  }
  return events;
}

// The same complaint is made again only after a while.
void SlamCore::complain(LogLevel level, const std::string& text) {
  const int64_t now = steady_ns();
  {
    const std::lock_guard lock(complaint_mutex_);
    std::erase_if(complaints_, [&](const auto& made) { return now - made.second >= kRepeatAfter; });
    if (!complaints_.emplace(without_digits(text), now).second) return;
  }
  middleware_.log(level, text);
}

std::unique_ptr<RosCore> make_core(const std::map<std::string, ParameterValue>& parameters, Middleware& middleware) {
  return std::make_unique<SlamCore>(Parameters::from_values(parameters), middleware);
}

}  // namespace dkb_ros
