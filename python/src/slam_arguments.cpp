// SPDX-License-Identifier: Apache-2.0
// The arguments of Slam, as the command line's options.
#include <utility>

#include "bindings.h"
#include "dkb/dataset/detector_choice.h"

namespace dkb::python {
namespace {

std::string setting_text(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  return py::str(value);
}

// Parts to switch off, by comma.
std::string disabled(const py::kwargs& a) {
  return argument<std::string>(a["disable"], "disable", "a str, parts by comma");
}

std::string text_or_empty(const py::kwargs& a, const char* name) {
  const py::object value = a[name];
  return value.is_none() ? "" : path_of(value, name);
}

}  // namespace

Options options_of(const py::kwargs& a) {
  const bool has_preset = !a["preset"].is_none();
  const std::string preset = has_preset ? argument<std::string>(a["preset"], "preset", "a str") : "default";
  Options options(preset);
  if (!a["config"].is_none()) options.load(path_of(a["config"], "config"));
  if (!a["settings"].is_none())
    for (const auto& [key, value] : argument<py::dict>(a["settings"], "settings", "a dict"))
      options.set(py::str(key), setting_text(value), "settings");
  if (has_preset && options.preset() != preset)
    throw InputError("preset: \"" + preset + "\", but the settings say `preset: " + options.preset() +
                     "`; leave one of them out");
  if (!a["filter"].is_none()) options.set("dynamics.filter", py::str(a["filter"]), "filter");
  options.disable(disabled(a));
  if (!a["seed"].is_none()) options.set("seed", py::str(a["seed"]), "seed");
  if (argument<bool>(a["final_ba"], "final_ba", "a bool")) options.set("global_ba.final", "true", "final_ba");
  const int threads = argument<int>(a["threads"], "threads", "an int");
  if (threads < 0) throw InvalidOption("threads", std::to_string(threads), "1, or 0 for as many as there is work for");
  options.threaded = threads != 1;
  options.realtime = argument<bool>(a["realtime"], "realtime", "a bool");
  options.dense_map = argument<bool>(a["dense"], "dense", "a bool");
  if (!a["base_from_cam"].is_none()) options.base_from_cam = pose_of(a["base_from_cam"], "base_from_cam");
  options.check();
  return options;
}

namespace {

// The kinds by name, joined by +, and the functions of `detector`: a str, a callable, or several of them.
std::pair<std::string, std::vector<py::object>> split_detector(const py::object& detector) {
  const bool several = py::isinstance<py::list>(detector) || py::isinstance<py::tuple>(detector);
  const py::list items = several ? py::list(detector) : py::list(py::make_tuple(detector));
  std::string kinds, command;
  std::vector<py::object> functions;
  for (const py::handle& item : items) {
    if (py::isinstance<py::str>(item) && command.empty() && item.cast<std::string>().starts_with("exec:"))
      command = item.cast<std::string>();  // comes last, since it may hold a +
    else if (py::isinstance<py::str>(item))
      kinds += (kinds.empty() ? "" : "+") + item.cast<std::string>();
    else if (PyCallable_Check(item.ptr()) != 0)
      functions.push_back(py::reinterpret_borrow<py::object>(item));
    else
      throw py::type_error(std::string("detector: must be a str, a callable or a list of them, not ") +
                           Py_TYPE(item.ptr())->tp_name);
  }
  if (py::len(items) == 0) throw InputError("detector: the list is empty; give \"none\" for no detector");
  if (!command.empty()) kinds += (kinds.empty() ? "" : "+") + command;
  return {kinds.empty() ? "none" : kinds, std::move(functions)};
}

}  // namespace

Detectors detectors_of(const py::kwargs& a, const Options& options, const Camera& camera,
                       const std::shared_ptr<Interruption>& interruption) {
  auto [kinds, functions] = split_detector(a["detector"]);
  DetectorChoice choice;
  choice.kinds = kinds;
  choice.model = text_or_empty(a, "model");
  choice.labels = text_or_empty(a, "labels");
  choice.classes = argument<std::string>(a["classes"], "classes", "a str");
  choice.inference = argument<std::string>(a["inference"], "inference", "a str");
  choice.boxes = text_or_empty(a, "boxes");
  choice.masks = text_or_empty(a, "masks");
  choice.every = argument<int>(a["detect_every"], "detect_every", "an int");
  choice.latency = argument<int>(a["detect_latency"], "detect_latency", "an int");
  choice = choice_beside(options, disabled(a), std::move(choice));
  Detectors made;
  {
    const Unlocked released;
    made = make_detectors(choice, camera);
  }
  if (options.dynamics.filter == FilterKind::none) return made;
  const bool slow = made.slow == nullptr && choice.every > 0;
  if (slow && functions.size() > 1)
    throw InputError("detect_every: one detector may be slow, and there are " + std::to_string(functions.size()) +
                     "; leave it out, or join them in one function");
  for (py::object& function : functions) {
    auto detector = python_detector(std::move(function), interruption);
    if (!slow) {
      made.prompt.push_back(std::move(detector));
      continue;
    }
    made.slow = std::move(detector);
    made.schedule = {choice.every, choice.latency > 0 ? choice.latency : choice.every};
  }
  return made;
}

}  // namespace dkb::python
