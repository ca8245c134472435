// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"
#include "ending.h"

// What the files of the extension module share. A function is called with the GIL held unless it says otherwise.
namespace dkb::python {

namespace py = pybind11;

void bind_camera(py::module_& module);
void bind_results(py::module_& module);
void bind_detector(py::module_& module);
void bind_frames(py::module_& module);
void bind_map(py::module_& module);
void bind_slam(py::module_& module);
void bind_evaluation(py::module_& module);

// --- arrays.cpp: numpy in and out ---

// Row-major float64 copies.
py::array_t<double> matrix_array(const Eigen::Ref<const Eigen::MatrixXd>& matrix);
py::array_t<double> vector_array(const Eigen::Vector3d& vector);
py::array_t<double> pose_array(const Rigid3& b_from_a);  // 4 x 4
// A copy for a value, None for nothing.
template <class T, class ToArray>
py::object array_or_none(const std::optional<T>& value, ToArray to_array) {
  return value ? py::object(to_array(*value)) : py::none();
}
// Of a 4 x 4 matrix whose upper left is a rotation. Throws InputError that begins with `name`.
Rigid3 pose_of(const py::handle& matrix, const std::string& name);
Matrix6d covariance_of(const py::handle& matrix, const std::string& name);

// Views of the arrays' memory, which must outlive them; rows may be apart. Throw InputError saying what the array is
// and what it must be. Colour: uint8 [H, W, 3] (rgb, or bgr), [H, W, 4] with a channel that is not looked at, [H, W]
// grey. Depth: uint16 [H, W] in units of 1 / depth_factor m, float32 [H, W] in m.
ImageView colour_view(const py::handle& array, bool bgr);
ImageView depth_view(const py::handle& array);
// A read-only array over memory that `owner` keeps alive.
py::array array_over(const py::dtype& type, const std::vector<py::ssize_t>& shape, const void* data,
                     const py::handle& owner);
// The image of a view as such an array, None for an empty one.
py::object image_array(const ImageView& view, const py::handle& owner);
// A mask: bool or uint8 [H, W], 255 where it is not 0. Throws InputError.
GreyImage mask_of(const py::handle& array);

// --- arguments ---

// The argument as T. Throws TypeError in one line.
template <class T>
T argument(const py::handle& value, const char* name, const char* what) {
  try {
    return py::cast<T>(value);
  } catch (const py::cast_error&) {
    throw py::type_error(std::string(name) + ": must be " + what + ", not " + Py_TYPE(value.ptr())->tp_name);
  }
}
// The arguments of a call by their names, as Python binds them. Throws TypeError in one line, where pybind would print
// all of them, whole images too.
class Call {
 public:
  // The first `positional` of `names` may be given by their places, and one argument of each by name.
  Call(const char* function, const py::args& args, const py::kwargs& kwargs, const std::vector<const char*>& names,
       size_t positional);
  // None where it was not given.
  py::object operator[](const char* name) const {
    return given_.contains(name) ? py::object(given_[name]) : py::none();
  }
  bool has(const char* name) const { return given_.contains(name); }
  bool flag(const char* name) const { return has(name) && argument<bool>((*this)[name], name, "a bool"); }

 private:
  py::dict given_;
};
// Text of a str or an object with __fspath__. Throws TypeError.
std::string path_of(const py::handle& value, const char* name);
// Nanoseconds of an int or numpy integer. Throws TypeError; a float of today's dates would not be exact.
int64_t stamp_of(const py::handle& value);

// --- camera.cpp ---

// Throws InputError naming what a frame's camera sees otherwise than the one it is given to.
void check_same_view(const Camera& of_frame, const Camera& wanted);

// --- messages ---

// A message of the library by the names of Python's keywords, in the place of the command line's options.
std::string python_words(std::string_view text);
// warnings.warn(text, SlamWarning) at the caller's line.
void warn(const std::string& text);

// --- frames.cpp ---

// A frame with what its recording says of it.
struct PyFrame {
  Frame frame;
  std::string stamp;  // [s] as recorded; of frames made from arrays as written to files
  size_t index = 0;   // of the pair in its recording
  std::shared_ptr<const Camera> camera;
};
// A frame from its stamp and the arguments `rgb`, `depth`, `prior`, `depth_stamp_ns` and `bgr`, copied. Throws
// InputError and TypeError.
PyFrame frame_from_arguments(const std::shared_ptr<const Camera>& camera, const py::object& stamp_ns, const Call& call);
// Of None, a MotionPrior or a 4 x 4 matrix.
std::optional<MotionPrior> prior_of(const py::object& prior);

// --- results.cpp ---

struct PyResult {
  FrameResult r;
  int width = 0, height = 0;  // [px] of the camera
};

// --- detector.cpp ---

// What a Python detector threw that is no fault of the image: KeyboardInterrupt, SystemExit. process() throws it.
// A slow detector's thread leaves it while another thread may be in process().
class Interruption {
 public:
  void set(std::exception_ptr what) {
    const std::lock_guard lock(mutex_);
    std::swap(what_, what);
  }
  std::exception_ptr take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(what_, nullptr);
  }
  static thread_local const Interruption* of_this_thread;  // whose detector this thread is in

 private:
  std::mutex mutex_;
  std::exception_ptr what_;
};
// A detector that calls `function`, from any thread.
std::shared_ptr<Detector> python_detector(py::object function, std::shared_ptr<Interruption> interruption);

// --- slam_arguments.cpp ---

// Of the arguments of Slam, as the command line's options say it, in its order.
Options options_of(const py::kwargs& arguments);
Detectors detectors_of(const py::kwargs& arguments, const Options& options, const Camera& camera,
                       const std::shared_ptr<Interruption>& interruption);

}  // namespace dkb::python
