// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "bindings.h"
#include "dkb/util/settings.h"

namespace dkb::python {
namespace {

PyObject *slam_warning = nullptr, *input_error = nullptr, *invalid_option = nullptr;

}  // namespace

void warn(const std::string& text) {
  const InPython calling;
  if (PyErr_WarnEx(slam_warning, python_words(text).c_str(), 1) != 0) throw py::error_already_set();
}

Call::Call(const char* function, const py::args& args, const py::kwargs& kwargs, const std::vector<const char*>& names,
           size_t positional) {
  const auto fail = [&](const std::string& what) { throw py::type_error(function + (": " + what)); };
  if (args.size() > positional)
    fail(std::to_string(args.size()) + " arguments by their places, and " + std::to_string(positional) +
         " can be: give the others by name");
  for (size_t i = 0; i < args.size(); ++i) given_[names[i]] = args[i];
  for (const auto& [key, value] : kwargs) {
    const auto name = key.cast<std::string>();
    const std::vector<std::string> known(names.begin(), names.end());
    if (std::find(known.begin(), known.end(), name) == known.end())
      fail("there is no argument \"" + name + "\"" + did_you_mean(name, known));
    if (given_.contains(name)) fail(name + " is given twice");
    given_[key] = value;
  }
}

std::string path_of(const py::handle& value, const char* name) {
  if (!py::isinstance<py::str>(value) && !py::hasattr(value, "__fspath__"))
    throw py::type_error(std::string(name) + ": must be a str or a path, not " + Py_TYPE(value.ptr())->tp_name);
  return py::str(py::module_::import("os").attr("fspath")(value));
}

int64_t stamp_of(const py::handle& value) {
  const py::object index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
  if (!index) {
    PyErr_Clear();
    throw py::type_error(std::string("stamp_ns: must be an int, in nanoseconds, not ") + Py_TYPE(value.ptr())->tp_name);
  }
  const int64_t stamp = PyLong_AsLongLong(index.ptr());
  if (PyErr_Occurred() == nullptr) return stamp;
  PyErr_Clear();
  throw InputError("stamp_ns: " + py::str(index).cast<std::string>() + " does not fit 64 bits of nanoseconds");
}

}  // namespace dkb::python

PYBIND11_MODULE(_core, module) {
  using namespace dkb::python;
  py::options options;
  options.disable_function_signatures();  // the docstrings have them
  options.disable_enum_members_docstring();

  input_error = PyErr_NewExceptionWithDoc(
      "dkb_slam._core.InputError",
      "Bad input, bad usage, or an output that cannot be written. One line: where, what, the remedy.", PyExc_ValueError,
      nullptr);
  invalid_option = PyErr_NewExceptionWithDoc(
      "dkb_slam._core.InvalidOption", "An option outside its range: its key, its value and its range, in one line.",
      input_error, nullptr);
  module.add_object("InputError", py::reinterpret_borrow<py::object>(input_error));
  module.add_object("InvalidOption", py::reinterpret_borrow<py::object>(invalid_option));
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      std::rethrow_exception(thrown);
    } catch (const dkb::InvalidOption& e) {
      PyErr_SetString(invalid_option, python_words(e.what()).c_str());
    } catch (const dkb::InputError& e) {
      PyErr_SetString(input_error, python_words(e.what()).c_str());
    }
  });
  slam_warning = PyErr_NewExceptionWithDoc("dkb_slam._core.SlamWarning",
                                           "Something a person should know: a frame that was skipped, a detector "
                                           "that failed. One line.",
                                           PyExc_UserWarning, nullptr);
  module.add_object("SlamWarning", py::reinterpret_borrow<py::object>(slam_warning));
  module.attr("__version__") = dkb::version();

  bind_camera(module);
  bind_results(module);
  bind_detector(module);
  bind_frames(module);
  bind_map(module);
  bind_slam(module);
  bind_evaluation(module);
  py::module_::import("atexit").attr("register")(py::cpp_function(&Closable::end_all));
}
