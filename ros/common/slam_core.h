// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <dkb_slam/source.h>
#include <dkb_slam/viewer.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "motion.h"
#include "outputs.h"
#include "pairing.h"
#include "parameters.h"
#include "ros_core.h"

namespace dkb_ros {

inline int64_t steady_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// When images came last, by the steady clock [ns]; 0 = never.
struct Arrivals {
  int64_t first = 0;  // of either stream
  int64_t colour = 0, depth = 0, pair = 0;
};

// The core at work. Tracking has a thread of its own, and so has what is slow and not urgent: map, path, diagnostics,
// grid.
class SlamCore final : public RosCore {
 public:
  SlamCore(const Parameters& parameters, Middleware& middleware);
  ~SlamCore() override;
  SlamCore(const SlamCore&) = delete;
  SlamCore& operator=(const SlamCore&) = delete;

  void colour(ImageMessage image) override;
  void depth(ImageMessage image) override;
  void camera_info(const CameraInfoMessage& info) override;
  void odometry(const OdometryMessage& odometry) override;
  void imu(const ImuMessage& imu) override;
  void initial_pose(const PoseMessage& pose) override;
  void save_map(const std::string& path, Done done) override;
  void load_map(const std::string& path, Done done) override;
  void reset(Done done) override;
  void pause(bool on, Done done) override;
  void localize_only(bool on, Done done) override;

 private:
  struct Counts {
    int64_t frames = 0, tracked = 0, predicted = 0, lost = 0, ambiguous = 0;
    int64_t paused = 0;    // frames that came while a service or a visitor of the page had paused
    int64_t rejected = 0;  // pairs that the library refused
    int64_t waiting = 0;   // pairs that came before the camera and its mount were known
    int64_t priors = 0;    // pairs that had a motion prior
  };
  struct Series {
    int64_t count = 0;
    double sum = 0, max = 0;
    void add(double value) { ++count, sum += value, max = std::max(max, value); }
  };
  // Of the frames since the last diagnostics. Latency: from the later image's arrival until the odometry is out;
  // overhead: what of it is neither the library's tracking nor its waiting.
  struct Recent {
    int64_t frames = 0;
    Series skew_ms, tracking_ms, latency_ms, overhead_ms;
  };
  struct LastPose {
    int64_t stamp_ns = 0;
    Rigid3 odom_from_base;
    Matrix6d covariance;   // right perturbation, in the base's axes
    bool guessed = false;  // not by the images
  };
  // What wheels or a gyroscope tell.
  struct Motion {
    dkb::MotionHistory history{};
    std::string frame = {};  // of the newest message
    bool told = false;       // that messages are left out
  };
  using Task = std::function<Answer(dkb::Slam&)>;

  void arrived(int64_t* last, int64_t now_ns);
  template <class Sample>
  void add_motion(Motion& motion, const Sample& sample, const std::string& frame, const std::string& what);
  void enqueue(std::vector<ImagePair> pairs);
  void request(Task task, Done done);
  void run_tracking();
  void run_reports();
  void run_grids();

  // On the tracking thread.
  void process(const ImagePair& pair);
  bool start(const ImagePair& pair);
  std::shared_ptr<dkb::Slam> make_slam(const dkb::Camera& camera, const dkb::Options& options);
  std::optional<dkb::Camera> find_camera();
  const std::string& camera_frame(const ImagePair& pair) const;
  dkb::FrameInput input_of(const ImagePair& pair);
  std::optional<dkb::MotionPrior> prior(int64_t stamp_ns);
  std::optional<Rigid3> cam_from(const std::string& frame);
  void publish(const ImagePair& pair, const dkb::FrameResult& result, const std::string& hindrance);
  void publish_odometry(const dkb::FrameResult& result);
  bool in_map_frame(const dkb::FrameResult& result);
  void publish_transforms(const dkb::FrameResult& result);
  void place_robots_odometry(int64_t stamp_ns, const Rigid3& map_from_base);
  void begin_in(dkb::Slam& slam, const std::string& map);
  void begin_anew();
  void begin_after_jump();
  void forget_motion();
  std::vector<dkb::Event> tell_events();
  void open_page();

  // On any thread.
  void complain(LogLevel level, const std::string& text);

  // On the thread of reports.
  void publish_map(const dkb::Slam& slam, int64_t stamp_ns);
  void publish_diagnostics(const dkb::Slam* slam);

  const Parameters parameters_;
  Middleware& middleware_;

  std::mutex input_mutex_;  // of what messages bring
  std::condition_variable input_changed_;
  Pairing pairing_;
  std::deque<ImagePair> pairs_;
  std::deque<std::pair<Task, Done>> tasks_;
  std::optional<CameraInfoMessage> camera_info_;
  Motion odometry_, gyro_;
  int64_t dropped_ = 0;      // pairs that found the queue full
  int64_t outdated_ = 0;     // pairs that waited when a service began another world
  int64_t late_motion_ = 0;  // messages of odometry and imu
  Arrivals arrivals_;

  // The tracking thread's own.
  Rigid3 base_from_cam_;
  std::string camera_frame_;
  std::optional<int64_t> last_stamp_ns_;             // of the frame that the library looked at last
  std::optional<LastPose> last_pose_;                // of the frame before, when it had one
  std::optional<Rigid3> map_from_odom_;              // as sent last
  std::deque<std::pair<int64_t, Rigid3>> unplaced_;  // map_from_base at times that the robot's odometry has not reached
  std::map<std::string, Rigid3> cam_from_frame_;     // of sensors that are fixed to the camera
  std::unique_ptr<dkb::Viewer> viewer_;              // where one is asked for
  std::string loaded_map_;                           // file to begin in again; empty = begin anew
  std::optional<int> last_map_;                      // FrameResult::map of the last pose
  int loaded_maps_ = 0;                              // when that was the map first: see loaded_maps()
  std::string failed_start_;                         // why there is no system and will be none
  bool paused_ = false;                              // by the service

  std::mutex complaint_mutex_;
  std::map<std::string, int64_t> complaints_;  // of the last seconds, without their numbers; when, by the steady clock

  std::mutex report_mutex_;  // of what several threads know
  std::condition_variable report_due_;
  std::shared_ptr<dkb::Slam> slam_;  // the tracking thread makes it once the camera is known, and it alone feeds it
  int64_t last_result_stamp_ns_ = 0;
  dkb::TrackingState state_ = dkb::TrackingState::initialising;
  std::string hindrance_ = hindrance_of({});  // of the newest result
  Counts counts_;
  Recent recent_;
  int64_t reported_dropped_ = 0;
  std::string trouble_;  // why there is no tracking, for people; empty when there is

  bool stopping_ = false;  // written under both mutexes
  std::thread tracking_, reports_, grids_;
};

}  // namespace dkb_ros
