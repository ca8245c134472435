// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <pybind11/stl.h>
#include <stdlib.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <future>
#include <mutex>

#include "bindings.h"
#include "dkb/dataset/odometry_track.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/stamps.h"

namespace dkb::python {
namespace {

// The file of a camera that was made in Python, for as long as a source is opened: sources are told their camera by
// name or file.
class CameraFile {
 public:
  explicit CameraFile(const Camera& camera) {
    std::string name = (std::filesystem::temp_directory_path() / "dkb_camera_XXXXXX").string();
    const int file = mkstemp(name.data());
    if (file < 0) throw InputError(name + ": no file for the camera can be made there");
    ::close(file);
    path_ = name;
    std::ofstream(path_) << camera.to_yaml();
  }
  ~CameraFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  CameraFile(const CameraFile&) = delete;
  CameraFile& operator=(const CameraFile&) = delete;
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

// A source as an iterator over its frames.
class PySource final : public Closable {
 public:
  PySource(const std::string& where, const py::object& camera, SourceOptions options, const std::string& prior_file) {
    std::optional<CameraFile> file;
    if (py::isinstance<Camera>(camera)) {
      file.emplace(camera.cast<const Camera&>());
      options.camera = file->path();
    } else if (!camera.is_none()) {
      options.camera = path_of(camera, "camera");
    }
    std::unique_ptr<Source> opened;  // close() sees a whole one or none
    {
      const Unlocked released;
      opened = open_source(where, options);
      if (!prior_file.empty()) opened = with_prior_file(std::move(opened), prior_file);
      description_ = opened->description();
    }
    refuse_at_end();
    camera_ = std::make_shared<const Camera>(opened->camera());
    size_ = opened->size();
    source_ = std::move(opened);
    if (!file) return;
    const size_t at = description_.find(options.camera);
    if (at != std::string::npos) description_.replace(at, options.camera.size(), "as given");
  }
  ~PySource() override { close(); }

  // Its threads end, and so does the iteration. Nobody waits for the lock and holds the GIL.
  void close() override {
    if (!source_) return;
    if (made_elsewhere()) {
      static_cast<void>(source_.release());  // it would wait for threads that are not here
      return;
    }
    source_->stop();
    {
      const Unlocked released(Entry::always);
      reading_.lock();
    }
    if (source_) counts_ = source_->counts();  // another thread may have closed it meanwhile
    std::unique_ptr<Source> ended = std::move(source_);
    reading_.unlock();
    const Unlocked released(Entry::always);
    ended.reset();
  }

  PyFrame next() {
    check_process();
    refuse_at_end();
    if (!source_) throw InputError(description_ + ": it is closed; open it again to read it");
    while (true) {
      SourceFrame next = wait_for_next();
      if (!source_) throw py::stop_iteration();
      for (const std::string& line : source_->take_warnings()) warn(line);
      switch (next.state) {
        case SourceState::frame:
          return {std::move(next.frame), std::move(next.stamp), next.index, camera_};
        case SourceState::skipped:
          ++skipped_;
          if (folds(next.note)) break;
          warn(fmt::format("frame {}: {}; frame skipped", next.index, next.note));
          break;
        case SourceState::unplugged:
          if (!unplugged_) warn(next.note.empty() ? "the device is unplugged; waiting for it" : next.note);
          break;
        case SourceState::ended:
          folds("");
          throw py::stop_iteration();
      }
      unplugged_ = next.state == SourceState::unplugged;
    }
  }

  // Of a closed one, too.
  bool closed() const { return source_ == nullptr; }
  const Camera& camera() const { return *camera_; }
  std::optional<size_t> size() const { return size_; }
  const std::string& description() const { return description_; }
  int skipped() const { return skipped_; }
  SourceCounts counts() const {
    check_process();
    refuse_at_end();
    return source_ ? source_->counts() : counts_;
  }

 private:
  void check_process() const {
    if (made_elsewhere())
      throw InputError(description_ + ": it was opened in another process; open it in each process");
  }

  // Whether the pair before was skipped for the same reason, of another file: such are told once, and at their end how
  // many they were.
  bool folds(const std::string& note) {
    const size_t colon = note.find(": ");
    std::string reason = colon == std::string::npos ? note : note.substr(colon + 2);
    if (!reason.empty() && reason == reason_) {
      ++folded_;
      return true;
    }
    const std::string before = std::exchange(reason_, std::move(reason));
    const int more = std::exchange(folded_, 0);
    if (more > 0) warn(fmt::format("{} more frames skipped: {}", more, before));
    return false;
  }

  // A device may let us wait for long, and Ctrl-C must work meanwhile: Python's handler of it runs on this thread.
  SourceFrame wait_for_next() {
    std::future<SourceFrame> pending;
    const Unlocked released;
    const std::unique_lock lock(reading_, std::try_to_lock);
    if (!lock.owns_lock()) throw InputError(description_ + ": another thread reads it; one at a time may");
    if (!source_) return {};
    pending = std::async(std::launch::async, [this] { return source_->next(); });
    while (pending.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      const Locked gil;
      if (PyErr_CheckSignals() == 0) continue;
      py::error_already_set interrupt;
      source_->stop();
      {
        const Unlocked waiting(Entry::always);
        pending.wait();
      }
      throw interrupt;
    }
    return pending.get();
  }

  std::unique_ptr<Source> source_;  // null when closed
  std::shared_ptr<const Camera> camera_;
  std::optional<size_t> size_;
  SourceCounts counts_;  // when it was closed
  std::mutex reading_;
  std::string description_;
  int skipped_ = 0, folded_ = 0;
  std::string reason_;  // why the last pair was skipped, without its file
  bool unplugged_ = false;
};

std::shared_ptr<PySource> open(const py::object& where, const py::object& camera, const py::kwargs& a) {
  SourceOptions options;
  options.start = argument<double>(a["start"], "start", "a number of seconds");
  if (!a["end"].is_none()) options.end = argument<double>(a["end"], "end", "a number of seconds");
  if (!a["max_frames"].is_none()) options.max_frames = argument<int64_t>(a["max_frames"], "max_frames", "an int");
  options.skip_pairs = argument<int64_t>(a["skip_pairs"], "skip_pairs", "an int");
  options.threaded = argument<bool>(a["threaded"], "threaded", "a bool");
  options.prior = prior_kind_named(argument<std::string>(a["prior"], "prior", "a str"), "prior");
  for (const auto& [name, topic] :
       {std::pair{"colour_topic", &options.colour_topic}, std::pair{"depth_topic", &options.depth_topic},
        std::pair{"info_topic", &options.info_topic}, std::pair{"odom_topic", &options.odom_topic},
        std::pair{"imu_topic", &options.imu_topic}})
    if (!a[name].is_none()) *topic = argument<std::string>(a[name], name, "a str");
  std::string prior_file;
  if (!a["prior_file"].is_none()) {
    prior_file = path_of(a["prior_file"], "prior_file");
    if ((options.prior != PriorKind::automatic && options.prior != PriorKind::none) || !options.odom_topic.empty() ||
        !options.imu_topic.empty())
      throw InputError("prior_file: it takes the place of prior, odom_topic and imu_topic; leave them out");
    options.prior = PriorKind::none;
  }
  return std::make_shared<PySource>(path_of(where, "source"), camera, options, prior_file);
}

std::string source_repr(const PySource& source) {
  return (source.closed() ? "Source(closed: " : "Source(") + source.description() + ")";
}

void bind_frame(py::module_& module) {
  py::class_<MotionPrior>(module, "MotionPrior",
                          R"(MotionPrior(previous_from_current, covariance=None, *, rotation_only=False)

What something else knows of the camera's motion since the frame before: wheels, an inertial unit, a planner.

previous_from_current: float64 [4, 4], camera axes, [m]; of the frames that process() was given last and now.
covariance: float64 [6, 6], right perturbation, [translation m, rotation rad], camera axes; None = the identity.
rotation_only: the translation is not known. Raises InputError for what is no motion or no covariance.)")
      .def(py::init([](const py::args& args, const py::kwargs& kwargs) {
        const Call call("MotionPrior", args, kwargs, {"previous_from_current", "covariance", "rotation_only"}, 2);
        MotionPrior prior;
        prior.previous_from_current = pose_of(call["previous_from_current"], "previous_from_current");
        prior.rotation_only = call.flag("rotation_only");
        if (const py::object covariance = call["covariance"]; !covariance.is_none())
          prior.covariance = covariance_of(covariance, "covariance");
        Frame().set_prior(prior);  // which judges it
        return prior;
      }))
      .def_property_readonly("previous_from_current",
                             [](const MotionPrior& p) { return pose_array(p.previous_from_current); })
      .def_property_readonly("covariance", [](const MotionPrior& p) { return matrix_array(p.covariance); })
      .def_readonly("rotation_only", &MotionPrior::rotation_only)
      .def("__repr__", [](const MotionPrior& p) {
        const Eigen::Vector3d& t = p.previous_from_current.translation;
        const double angle = Eigen::AngleAxisd(p.previous_from_current.rotation).angle();
        const auto sd = [&p](int first) { return std::sqrt(p.covariance.diagonal().segment<3>(first).maxCoeff()); };
        if (p.rotation_only) return fmt::format("MotionPrior({:.4f} rad, sd {:.2g} rad)", angle, sd(3));
        return fmt::format("MotionPrior(({:.4f}, {:.4f}, {:.4f}) m, {:.4f} rad, sd {:.2g} m and {:.2g} rad)", t.x(),
                           t.y(), t.z(), angle, sd(0), sd(3));
      });

  py::class_<PyFrame>(module, "Frame",
                      R"(Frame(camera, stamp_ns, rgb, depth, *, prior=None, depth_stamp_ns=None, bgr=False)

A pair of images, checked, copied and never changed again: what Slam.process() takes and open() gives. May be made on
another thread than the one that feeds Slam. Arguments as of Slam.process(). The arrays below are views without copies;
they keep the frame alive and are read-only.)")
      .def(py::init([](const py::args& args, const py::kwargs& kwargs) {
        const Call call("Frame", args, kwargs, {"camera", "stamp_ns", "rgb", "depth", "prior", "depth_stamp_ns", "bgr"},
                        4);
        return frame_from_arguments(
            std::make_shared<const Camera>(argument<Camera>(call["camera"], "camera", "a dkb_slam.Camera")),
            call["stamp_ns"], call);
      }))
      .def_property_readonly(
          "stamp_ns", [](const PyFrame& f) { return f.frame.stamp_ns(); }, "int: of the colour image, [ns].")
      .def_property_readonly(
          "depth_stamp_ns", [](const PyFrame& f) { return f.frame.depth_stamp_ns(); }, "int: of the depth image, [ns].")
      .def_readonly("stamp", &PyFrame::stamp, "str: the colour image's stamp [s] as its recording writes it.")
      .def_readonly("index", &PyFrame::index, "int: of the pair in its recording; skipped pairs count.")
      .def_property_readonly(
          "rgb", [](const py::object& self) { return image_array(self.cast<const PyFrame&>().frame.colour(), self); },
          "uint8 [H, W, 3], or None for grey cameras.")
      .def_property_readonly(
          "grey", [](const py::object& self) { return image_array(self.cast<const PyFrame&>().frame.grey(), self); },
          "uint8 [H, W].")
      .def_property_readonly(
          "depth", [](const py::object& self) { return image_array(self.cast<const PyFrame&>().frame.depth(), self); },
          "float32 [H, W], [m] along the optical axis, 0 = no data.")
      .def_property_readonly(
          "prior", [](const PyFrame& f) { return f.frame.prior(); }, "MotionPrior or None.")
      .def("__repr__", [](const PyFrame& f) {
        const ImageView depth = f.frame.depth();
        return fmt::format("Frame({} s, {} x {} px)", f.stamp, depth.width, depth.height);
      });
}

}  // namespace

PyFrame frame_from_arguments(const std::shared_ptr<const Camera>& camera, const py::object& stamp_ns,
                             const Call& call) {
  FrameInput input;
  input.stamp_ns = stamp_of(stamp_ns);
  const bool bgr = call.flag("bgr");
  const py::object rgb = call["rgb"], depth = call["depth"];  // held while they are read
  input.colour = colour_view(rgb, bgr);
  input.depth = depth_view(depth);
  input.prior = prior_of(call["prior"]);
  if (const py::object stamp = call["depth_stamp_ns"]; !stamp.is_none()) input.depth_stamp_ns = stamp_of(stamp);
  const Unlocked released;
  return {Frame(*camera, input), stamp_text(input.stamp_ns), 0, camera};
}

std::optional<MotionPrior> prior_of(const py::object& prior) {
  if (prior.is_none()) return std::nullopt;
  if (py::isinstance<MotionPrior>(prior)) return prior.cast<MotionPrior>();
  MotionPrior made;
  made.previous_from_current = pose_of(prior, "prior");
  return made;
}

void bind_frames(py::module_& module) {
  bind_frame(module);
  py::class_<PySource, std::shared_ptr<PySource>>(module, "Source", R"(An iterator over frames, as open() gives it.

Ended by close(), or by a `with` block: its camera, size and counts stay. One thread at a time reads it. The same
recording gives the same frames every time. Pairs that cannot be read are left out, with a SlamWarning; of those with
one reason in a row the first is told, then how many more.)")
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__", &PySource::next)
      .def(
          "__len__",
          [](const PySource& source) {
            if (!source.size()) throw py::type_error("source: how many frames there are is not known; size is None");
            return *source.size();
          },
          "size, where that is known, however many were read; raises TypeError where it is not.")
      .def("__bool__", [](const PySource&) { return true; })  // whatever its length
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](PySource& source, const py::args&) { source.close(); })
      .def("close", &PySource::close, "close()\n\nEnds it and its threads; from any thread.")
      .def_property_readonly(
          "camera", [](const PySource& source) { return Camera(source.camera()); },
          "Camera: the same for all frames, frame rate included.")
      .def_property_readonly("size", &PySource::size,
                             "int or None: how many pairs there are, where that is known; skipped ones included.")
      .def_property_readonly("skipped", &PySource::skipped, "int: pairs so far that could not be read.")
      .def_property_readonly(
          "counts",
          [](const PySource& source) {
            const SourceCounts c = source.counts();
            py::dict counts;
            counts["dropped"] = c.dropped;
            counts["unpaired"] = c.unpaired;
            counts["late"] = c.late;
            return counts;
          },
          "dict: images or messages that were `dropped`, `unpaired` or `late`.")
      .def_property_readonly("description", &PySource::description, "str: what is read, and by which list.")
      .def("__repr__", &source_repr);
  module.def("_open", &open);
}

}  // namespace dkb::python
