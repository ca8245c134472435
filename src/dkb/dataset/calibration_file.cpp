// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/calibration_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr size_t kMaxBytes = 1 << 20;
constexpr size_t kMaxNumbers = 64;  // of a matrix that is looked at
constexpr double kMillimetres = 1000;

const std::vector<std::string> kKeys{"image_width",
                                     "image_height",
                                     "camera_name",
                                     "camera_matrix",
                                     "distortion_model",
                                     "distortion_coefficients",
                                     "rectification_matrix",
                                     "projection_matrix",
                                     "depth_factor",
                                     "fps",
                                     "readout",
                                     "depth_min",
                                     "depth_max"};
const std::vector<std::string> kKeysOfOurs{"width", "height", "fx", "fy", "cx", "cy", "k1",
                                           "k2",    "k3",     "k4", "k5", "k6", "p1", "p2"};

bool holds(const std::vector<std::string>& keys, const std::string& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

// One file's nodes by their keys.
class Calibrated {
 public:
  Calibrated(std::string text, const std::string& name) : name_(name) {
    if (text.size() > kMaxBytes) throw InputError(name + ": is too large for a camera file");
    if (text.find('\0') != std::string::npos) throw InputError(name + ": is not a text file");
    if (text.starts_with("%YAML:1.0")) text[0] = '#';  // OpenCV's own spelling of a first line
    try {
      read(YAML::Load(text));
    } catch (const YAML::Exception& e) {
      throw InputError(place(e.mark) + ": is not valid YAML (" + excerpt(e.msg) + ")");
    }
  }

  bool has(const std::string& key) const { return nodes_.contains(key); }
  std::string where(const std::string& key) const { return nodes_.contains(key) ? nodes_.at(key).where : name_; }
  [[noreturn]] void fail(const std::string& key, const std::string& what) const {
    throw InputError(where(key) + ": " + key + ": " + what);
  }

  std::string text(const std::string& key) const {
    const YAML::Node& node = needed(key);
    if (!node.IsScalar()) fail(key, "must be a word");
    return node.Scalar();
  }
  double number(const std::string& key) const { return number_of(needed(key), key); }
  int side(const std::string& key) const {
    const double value = number(key);
    if (!(value >= 16 && value <= 16384 && value == std::floor(value))) fail(key, "must be 16 ... 16384 whole pixels");
    return static_cast<int>(value);
  }
  // The numbers of a matrix, `rows` and `columns` of it where they are not 0.
  std::vector<double> matrix(const std::string& key, int rows, int columns) const {
    const YAML::Node& node = needed(key);
    if (!node.IsMap()) fail(key, "must be a matrix with rows, cols and data");
    const YAML::Node data = node["data"];
    if (!data.IsDefined() || !data.IsSequence()) fail(key, "has no list of numbers `data`");
    if (data.size() > kMaxNumbers) fail(key, fmt::format("{} numbers are too many", data.size()));
    std::vector<double> numbers;
    for (const auto& item : data) numbers.push_back(number_of(item, key));
    double size = 1;
    for (const auto& [side, wanted] : {std::pair{"rows", rows}, std::pair{"cols", columns}}) {
      if (!node[side].IsDefined()) fail(key, std::string("has no `") + side + "`");
      const double told = number_of(node[side], key);
      if (wanted != 0 && told != wanted) fail(key, fmt::format("{} are {:g}; {} expected", side, told, wanted));
      size *= told;
    }
    if (size != static_cast<double>(numbers.size()))
      fail(key, fmt::format("holds {} numbers, and its rows and cols say {:g}", numbers.size(), size));
    return numbers;
  }

 private:
  struct Entry {
    YAML::Node node;
    std::string where;
  };
  std::string place(const YAML::Mark& mark) const {
    return mark.is_null() ? name_ : name_ + ":" + std::to_string(mark.line + 1);
  }
  void read(const YAML::Node& root) {
    if (!root.IsMap()) throw InputError(name_ + ": expected lines of the form `key: value`");
    for (const auto& item : root) {
      const std::string at = place(item.first.Mark());
      if (!item.first.IsScalar()) throw InputError(at + ": a key must be a word");
      const std::string& key = item.first.Scalar();
      if (holds(kKeysOfOurs, key))
        throw InputError(at + ": " + key +
                         ": a camera file has either camera_matrix or fx, fy, cx and cy; leave one out");
      if (!holds(kKeys, key)) {
        if (const std::string meant = did_you_mean(key, kKeys); !meant.empty())
          throw InputError(at + ": unknown key \"" + excerpt(key) + "\"" + meant);
        continue;
      }
      if (!nodes_.emplace(key, Entry{item.second, at}).second)
        throw InputError(at + ": key \"" + key + "\" is given twice");
    }
  }
  const YAML::Node& needed(const std::string& key) const {
    if (!has(key))
      throw InputError(name_ + ": key \"" + key +
                       "\" is missing; a calibration needs image_width, image_height and camera_matrix");
    return nodes_.at(key).node;
  }
  double number_of(const YAML::Node& node, const std::string& key) const {
    double value = 0;
    if (!node.IsScalar() || !parse_number(node.Scalar(), &value) || !std::isfinite(value))
      fail(key, node.IsScalar() ? "\"" + excerpt(node.Scalar()) + "\" is not a number" : "must be a number");
    return value;
  }

  const std::string& name_;
  std::map<std::string, Entry> nodes_;
};

void read_lens(const Calibrated& file, Camera& camera) {
  const std::vector<double> m = file.matrix("camera_matrix", 3, 3);
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
    file.fail("camera_matrix", "must be fx, 0, cx, 0, fy, cy, 0, 0, 1, by rows");
  camera.fx = m[0], camera.fy = m[4], camera.cx = m[2], camera.cy = m[5];
  camera.check();  // before its rays are looked at
  const std::string model = file.has("distortion_model") ? file.text("distortion_model") : "";
  if (!file.has("distortion_coefficients")) {
    if (!model.empty()) file.fail("distortion_model", "has no distortion_coefficients");
    return;
  }
  const std::vector<double> d = file.matrix("distortion_coefficients", 0, 0);
  try {
    camera.set_distortion(model.empty() && d.size() > 5 ? "rational_polynomial" : model, d);
  } catch (const InputError& e) {
    file.fail("distortion_coefficients", std::string(e.what()) + "; rectify the images, and give the camera of those");
  }
}

}  // namespace

bool is_calibration(const std::string& text) {
  for (const char* key : {"image_width", "camera_matrix"}) {
    const std::string line = std::string(key) + ":";
    if (text.starts_with(line) || text.find("\n" + line) != std::string::npos) return true;
  }
  return false;
}

Calibration parse_calibration(const std::string& text, const std::string& name) {
  const Calibrated file(text, name);
  Calibration read;
  Camera& camera = read.camera;
  try {
    camera.width = file.side("image_width"), camera.height = file.side("image_height");
    read.depth_assumed = !file.has("depth_factor");
    camera.depth_factor = kMillimetres;
    for (const auto& [key, field] : {std::pair{"depth_factor", &camera.depth_factor}, std::pair{"fps", &camera.fps},
                                     std::pair{"readout", &camera.readout}, std::pair{"depth_min", &camera.depth_min},
                                     std::pair{"depth_max", &camera.depth_max}})
      if (file.has(key)) *field = file.number(key);
    read_lens(file, camera);
    camera.check();
  } catch (const InvalidOption& e) {
    throw InputError(name + ": " + e.what());
  } catch (const YAML::Exception& e) {
    throw InputError(name + ": is not valid YAML (" + excerpt(e.msg) + ")");
  }
  return read;
}

}  // namespace dkb
