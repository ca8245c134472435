// SPDX-License-Identifier: Apache-2.0
#include "parameters.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace dkb_ros {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

std::vector<ParameterDescription> own_parameters() {
  return {
      {"map_frame", "map", "frame of the map, which is corrected and may jump"},
      {"odom_frame", "odom", "frame that never jumps, for steering"},
      {"base_frame", "base_link", "frame of the robot; the poses are its"},
      {"camera_frame", "", "optical frame of the colour camera; empty = as its images say"},
      {"base_from_cam", std::vector<double>{}, "[m, quaternion] mount of the camera, x y z qx qy qz qw; empty = by TF"},
      {"publish_map_tf", true, "send map -> odom to TF"},
      {"publish_odom_tf", true,
       "send odom -> base to TF, and topic odom; false: the robot does, and map -> odom goes on top of it"},
      {"camera", "", "camera file, or fr1, fr2, fr3, bonn, in the place of rgb/camera_info"},
      {"rectified", false, "colour images are rectified: take P of the CameraInfo, no distortion"},
      {"depth_factor", 1000.0, "[units per metre] of 16UC1 depth images", 1e-3, 1e6},
      // Further apart the library refuses them.
      {"sync_tolerance", 0.02, "[s] between the stamps of a colour image and its depth image", 0, 0.2},
      {"queue_size", int64_t{10}, "[frames] that may wait for tracking; then the oldest is dropped", 1, 1000},
      {"prior", "auto", "who helps where the images do not tell", -kInf, kInf, {"none", "odom", "imu", "auto"}},
      {"prior_drift", 0.01, "share that odom_prior is off by over 10 m where it gives no covariance", 1e-4, 1},
      {"detector", "auto", "what may move is found by: auto, yolo, motion, none, exec:COMMAND; several joined by +"},
      {"model", "", "ONNX file of the yolo detector"},
      {"labels", "", "class names of that model, one per line; empty = COCO's"},
      {"classes", "", "those of them that may move, by comma; empty = people, pets, and what people carry or ride"},
      {"inference",
       "auto",
       "what computes it; auto = ONNX Runtime where it is found, else OpenCV",
       -kInf,
       kInf,
       {"auto", "onnxruntime", "opencv"}},
      {"detect_every", int64_t{0}, "[frames] between detections; 0 = by the model's size", 0, 1000},
      {"detect_latency", int64_t{0}, "[frames] until a detection is used; 0 = by the model's size", 0, 1000},
      {"load_map", "", "map file to go on in"},
      {"localize_only", false, "do not change the map"},
      {"map_period", 1.0, "[s] between map_points and path; 0 = never", 0, 3600},
      {"grid_period", 0.0, "[s] between grids, which cost memory and time; 0 = never", 0, 3600},
      {"path_step", 0.05, "[m] between poses of the path", 0, 100},
      {"viewer_port", int64_t{-1}, "port of the live page in the browser; 0 = any, -1 = no page", -1, 65535},
      {"viewer_host", "127.0.0.1", "address to serve the page at; another lets others in, by the token that is logged"},
      {"preset", "default", "what the settings start from", -kInf, kInf, {"default", "paper", "orb"}},
  };
}

std::vector<ParameterDescription> settings() {
  std::vector<ParameterDescription> found;
  for (const dkb::Setting& s : dkb::Options().settings()) {
    ParameterDescription d{s.key, s.initial, s.meaning, s.min, s.max, s.choices};
    if (s.kind == dkb::SettingKind::boolean) d.initial = s.initial == "true";
    if (s.kind == dkb::SettingKind::whole) d.initial = int64_t{std::stoll(s.initial)};
    if (s.kind == dkb::SettingKind::number) d.initial = std::stod(s.initial);
    found.push_back(std::move(d));
  }
  return found;
}

std::string text_of(const ParameterValue& value) {
  std::ostringstream text;
  text.precision(17);
  if (const bool* b = std::get_if<bool>(&value)) text << (*b ? "true" : "false");
  if (const int64_t* i = std::get_if<int64_t>(&value)) text << *i;
  if (const double* d = std::get_if<double>(&value)) text << *d;
  if (const std::string* s = std::get_if<std::string>(&value)) text << *s;
  if (std::holds_alternative<std::vector<double>>(value)) text << "[]";
  return text.str();
}

std::string short_text_of(const ParameterValue& value) {
  const double* number = std::get_if<double>(&value);
  if (number == nullptr) return text_of(value);
  std::ostringstream text;
  text << *number;
  return text.str();
}

std::string range_of(const ParameterDescription& d) {
  std::string text;
  for (const std::string& c : d.choices) text += (text.empty() ? "" : ", ") + c;
  if (std::isfinite(d.min) && std::isfinite(d.max)) return short_text_of(d.min) + " ... " + short_text_of(d.max);
  if (std::isfinite(d.min)) return "from " + short_text_of(d.min);
  return text;
}

// Values by name, of the types that the table says.
class Values {
 public:
  explicit Values(const std::map<std::string, ParameterValue>& given) {
    for (const ParameterDescription& d : parameter_descriptions()) all_.emplace(d.name, d.initial);
    for (const auto& [name, value] : given) {
      const auto known = all_.find(name);
      if (known == all_.end()) throw dkb::InputError(name + ": there is no such parameter; docs/ros.md lists them");
      // An integer for a number is a convenience of launch files.
      const int64_t* whole = std::get_if<int64_t>(&value);
      if (whole != nullptr && std::holds_alternative<double>(known->second))
        known->second = static_cast<double>(*whole);
      else if (value.index() == known->second.index())
        known->second = value;
      else
        throw dkb::InputError(name + ": its type is wrong; docs/ros.md lists the parameters");
    }
  }

  template <class T>
  T get(const std::string& name) const {
    const T value = std::get<T>(all_.at(name));
    if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
      const ParameterDescription& d = description(name);
      if (!(static_cast<double>(value) >= d.min && static_cast<double>(value) <= d.max))
        throw dkb::InvalidOption(name, text_of(value), range_of(d));
    }
    return value;
  }
  int number(const std::string& name) const { return static_cast<int>(get<int64_t>(name)); }
  std::string text(const std::string& name) const { return get<std::string>(name); }
  std::string any(const std::string& name) const { return text_of(all_.at(name)); }

 private:
  static const ParameterDescription& description(const std::string& name) {
    const auto& all = parameter_descriptions();
    return *std::find_if(all.begin(), all.end(), [&](const ParameterDescription& d) { return d.name == name; });
  }

  std::map<std::string, ParameterValue> all_;
};

Rigid3 mount(const std::vector<double>& numbers) {
  const std::string remedy = "base_from_cam: it must be 7 numbers, x y z qx qy qz qw, with a quaternion of length 1";
  if (numbers.size() != 7) throw dkb::InputError(remedy);
  Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
  const Eigen::Vector3d t(numbers[0], numbers[1], numbers[2]);
  if (!t.allFinite() || !(std::abs(q.norm() - 1) < 0.01)) throw dkb::InputError(remedy);
  return {q.normalized(), t};
}

PriorKind prior_kind(const std::string& name) {
  if (name == "none") return PriorKind::none;
  if (name == "odom") return PriorKind::odom;
  if (name == "imu") return PriorKind::imu;
  if (name == "auto") return PriorKind::automatic;
  throw dkb::InputError("prior: there is no kind \"" + name + "\"; kinds: none, odom, imu, auto");
}

}  // namespace

const std::vector<ParameterDescription>& parameter_descriptions() {
  static const std::vector<ParameterDescription> all = [] {
    std::vector<ParameterDescription> list = own_parameters();
    for (ParameterDescription& d : settings()) list.push_back(std::move(d));
    return list;
  }();
  return all;
}

std::string parameter_table() {
  static constexpr const char* types[] = {"bool", "int", "double", "string", "double[]"};
  std::string table = "| parameter | type | range | default | meaning |\n|---|---|---|---|---|\n";
  for (const ParameterDescription& d : own_parameters())
    table += "| `" + d.name + "` | " + types[d.initial.index()] + " | " + range_of(d) + " | " +
             short_text_of(d.initial) + " | " + d.meaning + " |\n";
  return table;
}

Parameters Parameters::from_values(const std::map<std::string, ParameterValue>& given) {
  const Values values(given);
  Parameters p;
  p.map_frame = without_slash(values.text("map_frame"));
  p.odom_frame = without_slash(values.text("odom_frame"));
  p.base_frame = without_slash(values.text("base_frame"));
  p.camera_frame = without_slash(values.text("camera_frame"));
  const auto numbers = values.get<std::vector<double>>("base_from_cam");
  if (!numbers.empty()) p.base_from_cam = mount(numbers);
  p.publish_map_tf = values.get<bool>("publish_map_tf");
  p.publish_odom_tf = values.get<bool>("publish_odom_tf");
  p.camera = values.text("camera");
  p.rectified = values.get<bool>("rectified");
  p.depth_factor = values.get<double>("depth_factor");
  p.sync_tolerance = values.get<double>("sync_tolerance");
  p.queue_size = values.number("queue_size");
  p.prior = prior_kind(values.text("prior"));
  p.prior_drift = values.get<double>("prior_drift");
  p.detector.kinds = values.text("detector");
  p.detector.model = values.text("model");
  p.detector.labels = values.text("labels");
  p.detector.classes = values.text("classes");
  p.detector.inference = values.text("inference");
  p.detector.every = values.number("detect_every");
  p.detector.latency = values.number("detect_latency");
  p.load_map = values.text("load_map");
  p.localize_only = values.get<bool>("localize_only");
  p.map_period = values.get<double>("map_period");
  p.grid_period = values.get<double>("grid_period");
  p.path_step = values.get<double>("path_step");
  p.viewer_port = values.number("viewer_port");
  p.viewer_host = values.text("viewer_host");

  p.options = dkb::Options(values.text("preset"));
  const std::vector<ParameterDescription> own = own_parameters();
  for (const auto& [name, value] : given) {
    if (std::any_of(own.begin(), own.end(), [&, &key = name](const auto& d) { return d.name == key; })) continue;
    p.options.set(name, values.any(name), "parameter");
  }
  p.options.check();
  p.options.realtime = true;
  p.options.dense_map = p.grid_period > 0;
  return p;
}

}  // namespace dkb_ros
