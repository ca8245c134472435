// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <mutex>

#include "bindings.h"
#include "dkb/util/one_line.h"

namespace dkb::python {
namespace {

// What a Python detector is shown. Its arrays are copied when they are asked for, since the library's images end with
// the call and a Python program may keep what it was given.
class DetectorImage {
 public:
  explicit DetectorImage(const DetectorInput& input) : input_(&input), stamp_ns_(input.stamp_ns) {}

  int64_t stamp_ns() const { return stamp_ns_; }
  py::object rgb() {
    return copy(&rgb_, [](const DetectorInput& in) { return in.colour; });
  }
  py::object grey() {
    return copy(&grey_, [](const DetectorInput& in) { return in.grey; });
  }
  py::object depth() {
    return copy(&depth_, [](const DetectorInput& in) { return in.depth; });
  }
  void end() { input_ = nullptr; }

 private:
  template <class View>
  py::object copy(py::object* kept, View view) {
    if (*kept) return *kept;
    if (input_ == nullptr) throw InputError("image: it is read during the detector's call, not later; keep its arrays");
    const ImageView v = view(*input_);
    if (v.empty()) return py::none();
    *kept = image_array(v, py::none()).attr("copy")();
    return *kept;
  }

  const DetectorInput* input_;
  int64_t stamp_ns_;
  py::object rgb_, grey_, depth_;
};

std::string one_line_of(const py::error_already_set& error) {
  const std::string kind = py::str(error.type().attr("__name__"));
  std::string text = py::str(error.value());
  return one_line(kind + (text.empty() ? "" : ": " + text));
}

std::vector<Detection> boxes_of(const py::handle& object) {
  std::vector<Detection> boxes;
  for (const py::handle& item : py::iter(object)) {
    if (!py::isinstance<Detection>(item))
      throw InputError(fmt::format("its boxes hold a {}; give dkb_slam.Detection", Py_TYPE(item.ptr())->tp_name));
    boxes.push_back(item.cast<Detection>());
  }
  return boxes;
}

Detections detections_of(const py::object& answer) {
  Detections found;
  if (answer.is_none()) return found;
  if (py::isinstance<py::array>(answer)) {
    found.mask = mask_of(answer);
  } else if (py::isinstance<py::tuple>(answer) && py::len(answer) == 2 &&
             !py::isinstance<Detection>(answer[py::int_(1)])) {
    const py::object boxes = answer[py::int_(0)], mask = answer[py::int_(1)];
    if (!boxes.is_none()) found.boxes = boxes_of(boxes);
    if (!mask.is_none()) found.mask = mask_of(mask);
  } else if (py::isinstance<py::iterable>(answer)) {
    found.boxes = boxes_of(answer);
  } else {
    throw InputError(fmt::format("it returned a {}; give None, a mask, a list of dkb_slam.Detection, or (list, mask)",
                                 Py_TYPE(answer.ptr())->tp_name));
  }
  return found;
}

// While this thread is in a detector.
struct Inside {
  explicit Inside(const Interruption* whose) : before(std::exchange(Interruption::of_this_thread, whose)) {}
  ~Inside() { Interruption::of_this_thread = before; }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
  const Interruption* before;
};

class PythonDetector final : public Detector {
 public:
  PythonDetector(py::object function, std::shared_ptr<Interruption> interruption)
      : function_(std::move(function)), interruption_(std::move(interruption)) {
    const py::object name = py::getattr(function_, "__name__", py::type::of(function_).attr("__name__"));
    kind_ = py::str(name);
  }
  ~PythonDetector() override {
    const Locked gil;  // the library lets go of it on a thread of its choice
    function_ = py::object();
  }

  Detections detect(const DetectorInput& input) override {
    const Locked gil;
    DetectorImage image(input);
    const py::object shown = py::cast(std::move(image));
    const std::unique_ptr<DetectorImage, void (*)(DetectorImage*)> end(shown.cast<DetectorImage*>(),
                                                                       [](DetectorImage* i) { i->end(); });
    const Inside inside(interruption_.get());
    try {
      return detections_of(function_(shown));
    } catch (py::error_already_set& error) {
      fail(error);
    }
  }
  std::string kind() const override { return kind_; }
  void reset() override {
    const Locked gil;
    try {
      if (py::hasattr(function_, "reset")) function_.attr("reset")();
    } catch (py::error_already_set& error) {
      fail(error);
    }
  }

 private:
  [[noreturn]] void fail(const py::error_already_set& error) {
    if (!error.matches(PyExc_Exception)) interruption_->set(std::current_exception());
    throw InputError(one_line_of(error));
  }

  py::object function_;
  std::shared_ptr<Interruption> interruption_;
  std::string kind_;
};

}  // namespace

thread_local const Interruption* Interruption::of_this_thread = nullptr;

std::shared_ptr<Detector> python_detector(py::object function, std::shared_ptr<Interruption> interruption) {
  return std::make_shared<PythonDetector>(std::move(function), std::move(interruption));
}

void bind_detector(py::module_& module) {
  py::class_<DetectorImage>(module, "DetectorImage",
                            "What a detector of one's own is shown: one image, to be read during the call.")
      .def_property_readonly("stamp_ns", &DetectorImage::stamp_ns, "int: of the colour image, [ns].")
      .def_property_readonly("rgb", &DetectorImage::rgb, "uint8 [H, W, 3], or None for grey cameras. A copy.")
      .def_property_readonly("grey", &DetectorImage::grey, "uint8 [H, W]. A copy.")
      .def_property_readonly("depth", &DetectorImage::depth, "float32 [H, W], [m], 0 = no data. A copy.");
}

}  // namespace dkb::python
