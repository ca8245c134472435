// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/camera_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <vector>

#include "dkb/dataset/calibration_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

const std::vector<std::string> kRequired{"fx", "fy", "cx", "cy", "width", "height", "depth_factor"};
const std::vector<std::string> kBuiltin{"fr1", "fr2", "fr3", "bonn"};

// `rational`: with k4 to k6, which are written for rational cameras alone.
void bind(Settings* settings, CameraModel* c, bool rational = true) {
  settings->bind("width", &c->width, "[px]");
  settings->bind("height", &c->height, "[px]");
  settings->bind("fx", &c->fx, "[px] focal lengths");
  settings->bind("fy", &c->fy, "[px]");
  settings->bind("cx", &c->cx, "[px] principal point; (0, 0) is the centre of the top-left pixel");
  settings->bind("cy", &c->cy, "[px]");
  settings->bind("k1", &c->k1, "[1] radial distortion (Brown-Conrady)");
  settings->bind("k2", &c->k2, "[1]");
  settings->bind("k3", &c->k3, "[1]");
  if (rational) {
    settings->bind("k4", &c->k4, "[1] of the rational model: the radial polynomial is divided by 1 + k4 r^2 + ...");
    settings->bind("k5", &c->k5, "[1]");
    settings->bind("k6", &c->k6, "[1]");
  }
  settings->bind("p1", &c->p1, "[1] tangential distortion");
  settings->bind("p2", &c->p2, "[1]");
  settings->bind("depth_factor", &c->depth_factor, "[units per metre] of integer depth images");
  settings->bind("fps", &c->fps,
                 "[1/s] nominal frame rate; 0, or one that the first five stamps contradict = as they say");
  settings->bind("depth_min", &c->depth_min, "[m] nearer depth is treated as missing");
  settings->bind(
      "readout", &c->readout,
      "[s] rolling shutter: first row's exposure to the last row's, below 0 upside down; 0 = unknown or none");
  settings->bind(
      "depth_time_offset", &c->depth_time_offset,
      "[s] added to the stamps of depth images: when the colour camera saw what they show; 0 = unknown or none");
  settings->bind("depth_max", &c->depth_max, "[m] farther depth is treated as missing");
}

std::string builtin_names() {
  std::string names;
  for (const std::string& name : kBuiltin) names += (names.empty() ? "" : ", ") + name;
  return names;
}

// The words of a folder's name in lower case: rgbd_dataset_freiburg1_xyz -> rgbd, dataset, freiburg1, xyz.
std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    else if (!words.back().empty())
      words.emplace_back();
  }
  return words;
}

std::string camera_named_by(const std::string& folder_name) {
  for (std::string word : words_of(folder_name)) {
    if (word.rfind("freiburg", 0) == 0) word = "fr" + word.substr(8);
    if (std::find(kBuiltin.begin(), kBuiltin.end(), word) != kBuiltin.end()) return word;
  }
  return "";
}

CameraChoice from_file(const fs::path& path) {
  const std::string name = path.string(), text = read_file(path);
  const Calibration read = is_calibration(text) ? parse_calibration(text, name) : Calibration{parse_camera(text, name)};
  return {read.camera, name + (read.depth_assumed ? ", depth in millimetres (it says no depth_factor)" : ""),
          doubt_of(read.camera, name)};
}

std::string folder_name(const fs::path& folder) {
  const fs::path normal = fs::absolute(folder).lexically_normal();
  return (normal.has_filename() ? normal : normal.parent_path()).filename().string();
}

}  // namespace

CameraModel parse_camera(const std::string& text, const std::string& name) {
  if (is_calibration(text)) return parse_calibration(text, name).camera;
  CameraModel camera;
  Settings settings;
  bind(&settings, &camera);
  for (const SettingLine& line : settings.parse_yaml(text, name))
    if (line.key == "mask")
      camera.mask = read_camera_mask(line.value, line.where, name);
    else
      settings.set(line.key, line.value, line.where);
  for (const std::string& key : kRequired)
    if (settings.where(key).empty()) {
      std::string all;
      for (const std::string& other : kRequired) all += (all.empty() ? "" : ", ") + other;
      throw InputError(name + ": key \"" + key + "\" is missing; a camera file needs " + all);
    }
  try {
    camera.check();
  } catch (const InvalidOption& e) {
    const std::string message = e.what(), field = message.substr(0, message.find(':'));
    const std::vector<std::string> keys = settings.keys();
    const bool known = std::find(keys.begin(), keys.end(), field) != keys.end();
    const std::string where = known ? settings.where(field) : "";
    throw InputError((where.empty() ? name : where) + ": " + message);
  }
  return camera;
}

Camera Camera::load(const fs::path& path) {
  return parse_camera(read_file(path), path.string());
}

std::string Camera::to_yaml() const {
  Camera copy = *this;
  Settings settings;
  bind(&settings, &copy, copy.rational());
  return settings.to_yaml();
}

Camera without_limits(Camera camera) {
  camera.depth_min = 0, camera.depth_max = std::numeric_limits<float>::max();
  return camera;
}

std::string doubt_of(const Camera& camera, const std::string& name) {
  constexpr double kAspect = 1.5;   // of pixels, which are square in all cameras of this kind
  constexpr double kTan85 = 11.43;  // half of a field of view of 170 degrees, which no lens without fisheye has
  const double fx = camera.fx, fy = camera.fy;
  if (std::max(fx, fy) > kAspect * std::min(fx, fy))
    return fmt::format("{}: fx {:g} and fy {:g} are far apart; most cameras have square pixels", name, fx, fy);
  if (camera.width > 2 * kTan85 * fx || camera.height > 2 * kTan85 * fy)
    return fmt::format("{}: with fx {:g} and fy {:g} px the field of view is wider than 170 degrees; are they pixels?",
                       name, fx, fy);
  return "";
}

CameraChoice choose_camera(const std::string& option, const fs::path& dataset) {
  if (!option.empty()) {
    if (const auto camera = builtin_camera(option)) return {*camera, option + " (built in)"};
    std::error_code ec;
    if (!fs::exists(option, ec))
      throw InputError(option + ": neither a camera file nor a built-in camera (" + builtin_names() + ")" +
                       did_you_mean(option, kBuiltin));
    return from_file(option);
  }
  std::error_code ec;
  const fs::path beside = dataset / "camera.yaml";
  if (fs::exists(beside, ec)) return from_file(beside);
  const std::string name = camera_named_by(folder_name(dataset));
  if (const auto camera = builtin_camera(name)) return {*camera, name + " (from the folder's name)"};
  throw InputError(dataset.string() +
                   ": the camera is not known; put a camera.yaml into the folder, or give --camera FILE or one of " +
                   builtin_names());
}

}  // namespace dkb
