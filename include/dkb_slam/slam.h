// SPDX-License-Identifier: Apache-2.0
/// \file
/// RGB-D SLAM: frames in, one by one; poses, movers and a map out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/detector.h"
#include "dkb_slam/errors.h"
#include "dkb_slam/frame.h"
#include "dkb_slam/map.h"
#include "dkb_slam/options.h"

namespace dkb {

/// Something that happened, for whoever does not look at every frame's result.
struct Event {
  /// What it was.
  enum class Kind {
    keyframe,  ///< a frame became a keyframe
    loop,      ///< a place was seen again, and the map moved
    merge,     ///< two maps became one
    lost,      ///< the first frame without a pose
    found,     ///< the first frame with one again
    new_map,   ///< a map was begun, the first one included
    warning,   ///< something a person should know; `text` says what
  };
  Kind kind = Kind::warning;
  int frame = 0;         ///< index of the frame it came with, as in FrameResult
  int64_t stamp_ns = 0;  ///< of that frame
  int keyframe = -1;     ///< of keyframe, loop and merge
  /// One line for people, may be empty: of warnings what is wrong, of keyframes the rule, of a new map its number.
  std::string text;
};
DKB_SLAM_API const char* name_of(Event::Kind kind);

/// A frame of the trajectory.
struct TrajectoryFrame {
  int frame = 0;          ///< as in FrameResult; below 0: a keyframe of the map that was loaded
  int64_t stamp_ns = 0;   ///< of the colour image
  Rigid3 world_from_cam;  ///< as in FrameResult
  int map = 0;            ///< 0 = the first map; maps that were never joined have worlds of their own
};

/// How a file of a trajectory is written; docs/files.md says more.
enum class TrajectoryFormat {
  tum,    ///< `stamp tx ty tz qx qy qz qw`
  kitti,  ///< the first three rows of each pose's matrix, without stamps
  euroc   ///< a csv of stamps in [ns], positions and quaternions wxyz
};

/// Writes what Slam::trajectory(), online_trajectory() or keyframes() gave, by a temporary file and a rename: the poses
/// of the map of this number by stamp, as `dkb-slam run` and `export` write them; that map may have no pose yet.
/// `stamps`: of each frame by its number, as the file shall have it, as SourceFrame::stamp gives it; without them
/// stamps have six decimals or, where these do not suffice, nine. Throws InputError, and leaves a file that is there as
/// it is, when it cannot, or when a frame has no stamp in `stamps`.
DKB_SLAM_API void save_trajectory(const std::filesystem::path& path, const std::vector<TrajectoryFrame>& trajectory,
                                  int map = 0, TrajectoryFormat format = TrajectoryFormat::tum,
                                  const std::vector<std::string>& stamps = {});

/// What has happened since the world began.
struct Statistics {
  int frames = 0, tracked = 0, lost = 0;      ///< accepted; with a pose; without one although there is a map
  int predicted = 0;                          ///< of the tracked ones, by a motion prior or by depth alone
  int relocalisations = 0;                    ///< how often a lost camera was found
  int keyframes = 0, keyframes_inserted = 0;  ///< in the map now; ever made
  int maps = 0;                               ///< that are not joined
  int loops = 0, merges = 0;                  ///< places seen again; maps joined
  size_t map_points = 0;                      ///< in the map now
  int points_created = 0, points_culled = 0;  ///< map points ever made; taken out because too few frames found them
  int points_fused = 0;                       ///< joined with another that is the same
  int points_retracted = 0;                   ///< taken out because they lie on something that moves
  int keyframes_culled = 0;                   ///< taken out because others show the same
  std::map<std::string, int> keyframe_rules;  ///< keyframes by the rule that made them
  std::map<std::string, int> keyframe_tests;  ///< how often each test of the rule spoke for a keyframe
  double readout = 0, depth_time_offset = 0;  ///< [s] the camera's, or as learnt by now (Options::timing)
  long features_removed = 0;                  ///< features that the filter kept from tracking
  std::string detector = "none";              ///< kinds, joined by +
  double detector_rate_hz = 0;                ///< answers of the slow detector per second of the sequence
  int detector_latency_frames = 0;            ///< its DetectionSchedule::latency
  std::string detector_inference;             ///< Detectors::inference
  bool detector_failed = false;               ///< a detector threw ten times in a row: it is not asked any more
  /// Of a real-time run: how long [s] it was late and therefore did without half of "detection", "loop_search" and half
  /// of the "features"; each includes those after it. Empty in any other run, which leaves nothing out.
  std::map<std::string, double> degraded_s;
  std::map<std::string, StageSummary> stages;  ///< times by stage: "tracking", "mapping", "wait_mapper" ...
  /// By stage: how often it took how long. Element k counts durations from 2^(k/4 - 5) ms to those of element k + 1,
  /// the first and the 64th, which is the last that there may be, also what lies beyond.
  std::map<std::string, std::vector<int>> stage_histograms;
};

/// RGB-D SLAM. One thread feeds: process(), finish(), reset(), load_map(), save_map(), save_map_task(), dense_map(),
/// dense_map_task(), suggest_pose() and the switches. Each of these throws InputError, and does nothing, while another
/// is at work: on another thread, or because a detector or a keyframe rule calls it. Callbacks of on_event() may call
/// them. Any thread calls meanwhile: map(), trajectory(), online_trajectory(), keyframes(), statistics(),
/// take_events(), on_event(). Several systems may live in one process and know nothing of each other.
///
/// Deterministic: the same frames and options give the same poses and map to the last bit, with or without threads,
/// except with Options::realtime.
///
/// Throws InputError for bad input, which harms nothing: the frame is not counted and the next one goes on. Once a
/// worker thread has failed, every call of process() and finish() throws its error until reset() or load_map().
class DKB_SLAM_API Slam {
 public:
  /// `policy` decides about keyframes in the place of the built-in rule; may be null. Throws InvalidOption.
  explicit Slam(const Camera& camera, const Options& options = Options(), Detectors detectors = {},
                std::shared_ptr<KeyframePolicy> policy = nullptr);
  ~Slam();
  Slam(Slam&&) noexcept;
  Slam& operator=(Slam&&) noexcept;

  /// Tracks the next frame. Throws InputError when it does not fit the camera or its stamp does not rise. A stamp that
  /// is far ahead of the one before it is taken, and told as a warning: whatever comes before it is refused from then
  /// on.
  FrameResult process(const FrameInput& input);
  FrameResult process(const Frame& frame);  ///< likewise

  /// Waits for all outstanding work and takes its result: trajectory and map are complete then. process() may go on.
  void finish();
  /// Forgets the world, its frames and its clock. The next frame starts a new one.
  void reset();
  /// While paused, frames are answered with state `paused` and change nothing. Their FrameResult::frame is that of the
  /// last frame that was accepted, 0 before the first.
  void pause(bool on);
  /// While on, the map is not changed: no keyframes, no new map, and what tracking learns of points stays with it. It
  /// may be on before there is a map, since load_map() may follow and a reset() leaves it as it is: frames are
  /// `initialising` until then, and after 30 of them a warning says so.
  void localize_only(bool on);
  /// Somebody knows where the camera is, roughly: the next frames are sought there first, until one is found or a new
  /// map begins, at that place. The pose is in the world of the map, the covariance a right perturbation,
  /// [translation m, rotation rad], camera axes. It takes the place of what tracking knows: while the camera is tracked
  /// well, that pose is given up, and the frames are lost until one is found. A real-time run waits for the mapping
  /// that is due by now.
  /// Throws InputError when a number is not finite or the covariance is not symmetric and positive.
  void suggest_pose(const Rigid3& world_from_cam, const Matrix6d& covariance);
  /// Every frame's result then says which of the keyframe tests said what, with their numbers.
  void explain_keyframes(bool on);

  /// Writes the map as it is now, by a temporary file and a rename. A real-time run waits for what mapping should have
  /// done by now. Throws InputError, and leaves a file that is there as it is, when it cannot or the map has no
  /// keyframe yet.
  void save_map(const std::filesystem::path& path) const;
  /// The same, to be called on any thread and at any time: it writes the map of the moment of this call. For robots
  /// that save it while they go on tracking.
  std::function<void(const std::filesystem::path& path)> save_map_task() const;
  /// Forgets everything as reset() does, and goes on in that map: frames are lost until one is found in it. Poses are
  /// in the world that the map was made with, whatever Options::base_from_cam says now. The file holds no surfaces: the
  /// dense map begins anew. Throws InputError, and leaves all as it is, when the file is broken or was made with
  /// another camera or pyramid.
  void load_map(const std::filesystem::path& path);

  /// The map as tracking knows it.
  MapSnapshot map() const;
  /// Poses of all tracked frames by the map as it is now, each made more exact by those before and after it, as
  /// whatever carries a camera has mass (not with the presets "paper" and "orb"); complete after finish(). Some 0.1 ms
  /// a frame.
  std::vector<TrajectoryFrame> trajectory() const;
  /// The same frames as they were published.
  std::vector<TrajectoryFrame> online_trajectory() const;
  /// Keyframes of the map, by id.
  std::vector<TrajectoryFrame> keyframes() const;
  Statistics statistics() const;  ///< stages of other threads are complete after finish()

  /// The still world from the keyframes so far; takes seconds. Of maps that are not joined, that of the last frame with
  /// a pose. A map that was loaded has no images: only keyframes made since then are in it, and without new ones there
  /// is no grid. Throws InputError when Options::dense_map is off.
  DenseMap dense_map() const;
  DenseMap dense_map(int map) const;  ///< likewise, of the map of this number, as TrajectoryFrame::map has it
  /// The first of these, to be called on any thread and at any time: it makes the map of the moment of this call, which
  /// itself takes no time. For robots that want a grid while they go on tracking.
  std::function<DenseMap()> dense_map_task() const;

  /// What happened since the last call, oldest first; at most the newest 10,000 are kept. Nothing while a callback is
  /// set.
  std::vector<Event> take_events();
  /// Runs a task at once or later, on a thread of its choice, in the order in which tasks are given to it.
  using Executor = std::function<void(std::function<void()> task)>;
  /// Calls `callback` for each event: on the feeding thread before process() returns, or where `executor` runs it.
  /// An exception of the callback leaves process() or finish() when all events of the frame have been delivered, the
  /// first one if there are several. The frame counts then, but its result is lost. An empty callback ends it.
  void on_event(std::function<void(const Event&)> callback, Executor executor = {});

  const Camera& camera() const;    ///< as given
  const Options& options() const;  ///< as given

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dkb
