// SPDX-License-Identifier: Apache-2.0
#include "dkb_slam/slam.h"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <deque>
#include <mutex>

#include "bindings.h"
#include "dkb/dataset/trajectory_formats.h"

namespace dkb::python {
namespace {

// The first map is there before it has begun.
void check_map(const Slam& slam, int map) {
  const int maps = std::max(1, slam.statistics().maps);
  if (map < 0 || map >= maps)
    throw InputError(fmt::format("map: there is no map {}; there {} 0{}", map, maps == 1 ? "is" : "are",
                                 maps == 1 ? "" : fmt::format(" ... {}", maps - 1)));
}

// Slam with what Python adds: at rest before the interpreter goes, never two feeding threads, which the library's
// other calls of the feeding thread take turns with, events kept for polling.
class PySlam final : public Closable {
 public:
  PySlam(const Camera& camera, const py::kwargs& a) : camera_(std::make_shared<const Camera>(camera)) {
    const Options options = options_of(a);
    Detectors detectors = detectors_of(a, options, camera, interruption_);
    std::shared_ptr<Slam> made;  // close() sees a whole one or none
    {
      const Unlocked released;
      made = std::make_shared<Slam>(camera, options, std::move(detectors));
      made->on_event([this](const Event& event) { keep(event); });
    }
    refuse_at_end();
    slam_ = std::move(made);
  }
  ~PySlam() override { close(); }

  void close() override {
    if (!slam_) return;
    std::shared_ptr<Slam> ended = std::move(slam_);
    if (made_elsewhere()) {
      new std::shared_ptr<Slam>(std::move(ended));  // it would wait for threads that are not here
      return;
    }
    const Unlocked released(Entry::always);  // its threads may wait for the GIL, and it waits for them
    ended.reset();
  }
  const Camera& camera() const { return *camera_; }
  bool closed() const { return slam_ == nullptr; }

  // Work of the feeding thread, without the GIL.
  template <class Work>
  void feed(const Work& work) {
    std::exception_ptr interrupted;
    std::vector<std::string> warnings;
    check_outside_detector();
    run([&](Slam& slam) {
      const std::unique_lock feeder(feeding_, std::try_to_lock);
      if (!feeder.owns_lock())
        throw InputError("slam: another thread is in a call of it; one thread at a time feeds it");
      const std::lock_guard lock(turn_);
      std::exception_ptr failed;
      try {
        work(slam);
      } catch (...) {
        failed = std::current_exception();
      }
      // Before another thread may feed. An interruption comes first: whoever interrupts waits for nothing else.
      interrupted = interruption_->take();
      if (interrupted) return;
      if (failed) std::rethrow_exception(failed);
      warnings = std::exchange(warnings_, {});
    });
    if (interrupted) std::rethrow_exception(interrupted);
    for (const std::string& text : warnings) warn(text);
  }
  // Work that waits for its turn beside the feeding thread, which in turn waits for it: it is to be short. Without the
  // GIL.
  template <class Work>
  void visit(const Work& work) {
    check_outside_detector();
    run([&](Slam& slam) {
      const std::lock_guard lock(turn_);
      work(slam);
    });
  }
  // Work that any thread may do meanwhile, without the GIL.
  template <class Work>
  void run(const Work& work) const {
    check_usable();
    std::shared_ptr<Slam> slam = slam_;
    const Unlocked released;
    const std::shared_ptr<Slam> mine = std::move(slam);  // given back before the GIL is taken, see close()
    work(*mine);
  }

  PyResult process(const py::args& args, const py::kwargs& kwargs) {
    check_usable();
    const Call call("process", args, kwargs, {"frame", "rgb", "depth", "prior", "stamp_ns", "depth_stamp_ns", "bgr"},
                    4);
    const py::object first = call[call.has("stamp_ns") ? "stamp_ns" : "frame"];
    const bool is_frame = py::isinstance<PyFrame>(first);
    if (first.is_none() || (call.has("frame") && call.has("stamp_ns")) ||
        (is_frame && (call.has("rgb") || call.has("depth") || call.has("depth_stamp_ns"))))
      throw py::type_error("process: give a frame, or stamp_ns, rgb and depth");
    PyFrame given;
    if (is_frame) {
      given = first.cast<const PyFrame&>();
      check_same_view(*given.camera, *camera_);
      if (const py::object prior = call["prior"]; !prior.is_none()) given.frame.set_prior(prior_of(prior));
    } else {
      given = frame_from_arguments(camera_, first, call);
    }
    PyResult result;
    feed([&](Slam& slam) {
      result = {slam.process(given.frame), camera_->width, camera_->height};
      if (result.r.state == TrackingState::paused) return;
      const std::lock_guard lock(stamps_mutex_);
      stamps_.resize(static_cast<size_t>(result.r.frame));
      stamps_.push_back(std::move(given.stamp));
    });
    return result;
  }
  void reset() {
    feed([&](Slam& slam) {
      slam.reset();
      forget_stamps();
    });
  }
  void load_map(const std::string& path) {
    feed([&](Slam& slam) {
      slam.load_map(path);
      forget_stamps();
    });
  }
  // Frames may be processed while a file is written.
  void save_map(const std::string& path) {
    std::function<void(const std::filesystem::path&)> task;
    visit([&](Slam& slam) { task = slam.save_map_task(); });
    const Unlocked other_threads;
    task(path);
  }
  void save_trajectory(const std::string& path, int map, bool online, const std::string& format) const {
    const TrajectoryFormat as = trajectory_format_named(format, "format");
    run([&](Slam& slam) {
      check_map(slam, map);
      const auto [frames, stamps] = stamped_trajectory(slam, online);
      dkb::save_trajectory(path, frames, map, as, stamps);
    });
  }
  std::vector<Event> take_events() {
    const std::lock_guard lock(events_mutex_);
    std::vector<Event> events(std::make_move_iterator(events_.begin()), std::make_move_iterator(events_.end()));
    events_.clear();
    return events;
  }

 private:
  void check_usable() const {
    if (made_elsewhere()) throw InputError("slam: it was made in another process; make one in each process");
    refuse_at_end();
    if (!slam_) throw InputError("slam: it is closed");
  }
  // process() waits for its detector, which must not wait for process().
  void check_outside_detector() const {
    if (Interruption::of_this_thread == interruption_.get())
      throw InputError("slam: its detector calls it; call it between the frames");
  }
  void forget_stamps() {
    const std::lock_guard lock(stamps_mutex_);
    stamps_.clear();
    ++world_;
  }
  // Of one world, and of frames whose stamps are known: another thread may be in the next one, or begin anew.
  std::pair<std::vector<TrajectoryFrame>, std::vector<std::string>> stamped_trajectory(const Slam& slam,
                                                                                       bool online) const {
    while (true) {
      std::unique_lock lock(stamps_mutex_);
      std::vector<std::string> stamps = stamps_;
      const int world = world_;
      lock.unlock();
      std::vector<TrajectoryFrame> frames = online ? slam.online_trajectory() : slam.trajectory();
      lock.lock();
      if (world != world_) continue;
      std::erase_if(frames, [&](const TrajectoryFrame& f) { return f.frame >= static_cast<int>(stamps.size()); });
      return {std::move(frames), std::move(stamps)};
    }
  }
  void keep(const Event& event) {  // on the feeding thread, within feed()
    if (event.kind == Event::Kind::warning) warnings_.push_back(fmt::format("frame {}: {}", event.frame, event.text));
    const std::lock_guard lock(events_mutex_);
    events_.push_back(event);
    if (events_.size() > 10000) events_.pop_front();
  }

  const std::shared_ptr<const Camera> camera_;
  std::shared_ptr<Slam> slam_;  // null when closed
  std::mutex feeding_;          // by whom no other may feed
  std::mutex turn_;             // for who calls what only one thread at a time may
  std::shared_ptr<Interruption> interruption_ = std::make_shared<Interruption>();
  mutable std::mutex stamps_mutex_;
  std::vector<std::string> stamps_;    // of each frame, as it shall be written
  int world_ = 0;                      // how often they were forgotten
  std::vector<std::string> warnings_;  // not yet shown
  std::mutex events_mutex_;
  std::deque<Event> events_;
};

// Stamps and poses of the frames of one map, by stamp.
py::tuple trajectory_arrays(std::vector<TrajectoryFrame> frames, int map) {
  std::erase_if(frames, [&](const TrajectoryFrame& f) { return f.map != map; });
  std::stable_sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.stamp_ns < b.stamp_ns; });
  const auto n = static_cast<py::ssize_t>(frames.size());
  py::array_t<int64_t> stamps(n);
  py::array_t<double> poses({n, py::ssize_t{4}, py::ssize_t{4}});
  double* out = poses.mutable_data();
  for (py::ssize_t i = 0; i < n; ++i) {
    const TrajectoryFrame& frame = frames[static_cast<size_t>(i)];
    stamps.mutable_at(i) = frame.stamp_ns;
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> pose(out + 16 * i);
    pose.setIdentity();
    pose.topLeftCorner<3, 3>() = frame.world_from_cam.matrix3();
    pose.topRightCorner<3, 1>() = frame.world_from_cam.translation;
  }
  return py::make_tuple(stamps, poses);
}

py::tuple trajectory(const PySlam& slam, int map, bool online) {
  std::vector<TrajectoryFrame> frames;
  slam.run([&](Slam& s) {
    check_map(s, map);
    frames = online ? s.online_trajectory() : s.trajectory();
  });
  return trajectory_arrays(std::move(frames), map);
}

py::tuple keyframes(const PySlam& slam, int map) {
  std::vector<TrajectoryFrame> frames;
  slam.run([&](Slam& s) {
    check_map(s, map);
    frames = s.keyframes();
  });
  return trajectory_arrays(std::move(frames), map);
}

MapSnapshot snapshot(const PySlam& slam) {
  MapSnapshot map;
  slam.run([&](Slam& s) { map = s.map(); });
  return map;
}

Statistics statistics_of(const PySlam& slam) {
  Statistics s;
  slam.run([&](Slam& inner) { s = inner.statistics(); });
  return s;
}

py::dict statistics(const PySlam& slam) {
  const Statistics s = statistics_of(slam);
  py::dict d;
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, int>>{{"frames", s.frames},
                                                          {"tracked", s.tracked},
                                                          {"lost", s.lost},
                                                          {"predicted", s.predicted},
                                                          {"relocalisations", s.relocalisations},
                                                          {"keyframes", s.keyframes},
                                                          {"keyframes_inserted", s.keyframes_inserted},
                                                          {"maps", s.maps},
                                                          {"loops", s.loops},
                                                          {"merges", s.merges},
                                                          {"points_created", s.points_created},
                                                          {"points_culled", s.points_culled},
                                                          {"points_fused", s.points_fused},
                                                          {"points_retracted", s.points_retracted},
                                                          {"keyframes_culled", s.keyframes_culled},
                                                          {"detector_latency_frames", s.detector_latency_frames}})
    d[name] = value;
  d["map_points"] = s.map_points;
  d["features_removed"] = s.features_removed;
  d["keyframe_rules"] = s.keyframe_rules;
  d["keyframe_tests"] = s.keyframe_tests;
  d["readout"] = s.readout;
  d["depth_time_offset"] = s.depth_time_offset;
  d["detector"] = s.detector;
  d["detector_rate_hz"] = s.detector_rate_hz;
  d["detector_inference"] = s.detector_inference;
  d["detector_failed"] = s.detector_failed;
  py::dict stages;
  for (const auto& [name, stage] : s.stages) {
    py::dict times;
    times["mean_ms"] = stage.mean_ms;
    times["median_ms"] = stage.median_ms;
    times["p95_ms"] = stage.p95_ms;
    times["max_ms"] = stage.max_ms;
    times["count"] = stage.count;
    stages[py::str(name)] = times;
  }
  d["stages"] = stages;
  return d;
}

std::string repr_of(const PySlam& slam) {
  if (slam.made_elsewhere()) return "Slam(of another process)";
  if (slam.closed()) return "Slam(closed)";
  const Statistics s = statistics_of(slam);
  return fmt::format("Slam({} x {} px, {} of {} frames tracked, {} keyframes, {} map points)", slam.camera().width,
                     slam.camera().height, s.tracked, s.frames, s.keyframes, s.map_points);
}

DenseMap dense_map(PySlam& slam) {
  std::function<DenseMap()> task;
  slam.visit([&](Slam& s) { task = s.dense_map_task(); });
  // It takes seconds, in which frames may be processed.
  const Unlocked other_threads;
  return task();
}

}  // namespace

void bind_slam(py::module_& module) {
  py::class_<PySlam>(module, "Slam")
      .def(py::init<const Camera&, const py::kwargs&>())
      .def("process", &PySlam::process,
           R"(process(frame, *, prior=None) -> FrameResult
process(stamp_ns, rgb, depth, prior=None, *, depth_stamp_ns=None, bgr=False) -> FrameResult

Tracks the next frame: one of open(), or images as numpy arrays, which are read during the call without being copied
first. Only their rows need to be contiguous.

stamp_ns: int, [ns] of the colour image, middle of the exposure; rises from frame to frame.
rgb: uint8 [H, W, 3], [H, W, 4] (the last channel is not looked at) or [H, W] (grey); bgr=True: in OpenCV's order.
depth: uint16 [H, W] in units of 1 / depth_factor m, or float32 [H, W] in m; 0 and not finite = no data; registered to
    the colour image.
prior: MotionPrior, or float64 [4, 4] previous_from_current, where something else knows of the motion.
depth_stamp_ns: int, [ns] of the depth image; None = the colour image's.

Other threads run meanwhile. Raises InputError for images that do not fit the camera, a frame of another camera and
stamps that do not rise; the frame is not counted then and the next one goes on. Shows a SlamWarning when a detector
fails.)")
      .def(
          "finish", [](PySlam& s) { s.feed([](Slam& slam) { slam.finish(); }); },
          "finish()\n\nWaits for all outstanding work: trajectory and map are complete then. process() may go on.")
      .def("reset", &PySlam::reset, "reset()\n\nForgets the world, its frames and its clock.")
      .def(
          "pause", [](PySlam& s, bool on) { s.feed([on](Slam& slam) { slam.pause(on); }); }, py::arg("on") = true,
          "pause(on=True)\n\nWhile paused, frames are answered with state \"paused\" and change nothing.")
      .def(
          "localize_only", [](PySlam& s, bool on) { s.feed([on](Slam& slam) { slam.localize_only(on); }); },
          py::arg("on") = true,
          "localize_only(on=True)\n\nWhile on, the map is not changed. It may be on before there is a map, since "
          "load_map() may\nfollow: frames are \"initialising\" until then, and after 30 of them a SlamWarning says so.")
      .def(
          "suggest_pose",
          [](PySlam& s, const py::object& pose, const py::object& covariance) {
            const Rigid3 world_from_cam = pose_of(pose, "world_from_cam");
            const Matrix6d sure = covariance_of(covariance, "covariance");
            s.feed([&](Slam& slam) { slam.suggest_pose(world_from_cam, sure); });
          },
          py::arg("world_from_cam"), py::arg("covariance"),
          R"(suggest_pose(world_from_cam, covariance)

Somebody knows where the camera is, roughly: the next frames are sought there first, until one is found or a new map
begins, at that place. world_from_cam: float64 [4, 4] in the map's world, [m]; covariance: float64 [6, 6] of its right
perturbation, [translation m, rotation rad], camera axes. Raises InputError for what is no pose or no covariance.)")
      .def(
          "explain_keyframes", [](PySlam& s, bool on) { s.feed([on](Slam& slam) { slam.explain_keyframes(on); }); },
          py::arg("on") = true,
          "explain_keyframes(on=True)\n\nEvery result's keyframe_explanation then says which test said what.")
      .def("close", &PySlam::close,
           "close()\n\nEnds its threads; nothing can be asked of it then. Also at the end of a `with` block.")
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](PySlam& slam, const py::args&) { slam.close(); })
      .def(
          "save_map", [](PySlam& s, const py::object& path) { s.save_map(path_of(path, "path")); }, py::arg("path"),
          "save_map(path)\n\nWrites the map as it is now; from any thread, frames may be processed meanwhile. Raises "
          "InputError when it cannot.")
      .def(
          "load_map", [](PySlam& s, const py::object& path) { s.load_map(path_of(path, "path")); }, py::arg("path"),
          "load_map(path)\n\nForgets everything and goes on in that map: frames are lost until one is found in it.\n"
          "Poses are in the world that the map was made with, whatever base_from_cam says now.\n"
          "Raises InputError, and leaves all as it is, when the file is broken or of another camera.")
      .def(
          "save_trajectory",
          [](const PySlam& s, const py::object& path, int map, bool online, const std::string& format) {
            s.save_trajectory(path_of(path, "path"), map, online, format);
          },
          py::arg("path"), py::kw_only(), py::arg("map") = 0, py::arg("online") = false, py::arg("format") = "tum",
          "save_trajectory(path, *, map=0, online=False, format=\"tum\")\n\nWrites what trajectory() gives, as "
          "`dkb-slam run` does: stamp [s], position [m],\nquaternion xyzw; \"kitti\" and \"euroc\" as `dkb-slam export "
          "--format` does. From any thread.")
      .def("trajectory", &trajectory, py::kw_only(), py::arg("map") = 0, py::arg("online") = false,
           R"(trajectory(*, map=0, online=False) -> (stamps_ns, poses)

Every tracked frame by the map as it is now, smoothed by the frames around it; complete after finish(). From any thread.

stamps_ns: int64 [N]; poses: float64 [N, 4, 4], world_from_cam, [m]. map: 0 = the first one; maps that were never joined
have worlds of their own. online: as each frame was published.)")
      .def("keyframes", &keyframes, py::kw_only(), py::arg("map") = 0,
           "keyframes(*, map=0) -> (stamps_ns, poses)\n\nKeyframes of the map, as trajectory() has them.")
      .def("map", &snapshot, "map() -> MapSnapshot\n\nThe map as tracking knows it; cheap, from any thread.")
      .def(
          "map_points",
          [](const PySlam& slam) {
            const py::object points = py::cast(snapshot(slam)).attr("points")();
            return py::make_tuple(points.attr("xyz"), points.attr("rgb"));
          },
          "map_points() -> (xyz, rgb)\n\nxyz: float64 [M, 3], [m] in the world; rgb: uint8 [M, 3]. From any thread.")
      .def("dense_map", &dense_map,
           "dense_map() -> DenseMap\n\nThe still world from the keyframes so far; takes seconds, in which frames "
           "may be processed; from any thread. Raises InputError "
           "without Slam(dense=True).")
      .def("events", &PySlam::take_events,
           "events() -> list[Event]\n\nWhat happened since the last call, oldest first; at most the newest 10,000.")
      .def("statistics", &statistics, "statistics() -> dict\n\nWhat has happened since the world began; times in [ms].")
      .def_property_readonly(
          "camera", [](const PySlam& slam) { return Camera(slam.camera()); }, "Camera: as given.")
      .def(
          "config_yaml",
          [](const PySlam& slam) {
            std::string text;
            slam.run([&](Slam& s) { text = s.options().to_yaml(); });
            return text;
          },
          "config_yaml() -> str\n\nThe preset and every setting, a line each with its unit and meaning.")
      .def("__repr__", [](const PySlam& slam) { return repr_of(slam); });
}

}  // namespace dkb::python
