// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/calibration_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"
#include "dkb/util/yaml_reader.h"

namespace dkb {
namespace {

constexpr size_t kMaxNumbers = 64;  // of a matrix that is looked at
const Range kSides{16, 16384};      // [px]

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
                                     "depth_time_offset",
                                     "depth_min",
                                     "depth_max",
                                     "mask"};
const std::vector<std::string> kKeysOfOurs{"width", "height", "fx", "fy", "cx", "cy", "k1",
                                           "k2",    "k3",     "k4", "k5", "k6", "p1", "p2"};

bool holds(const std::vector<std::string>& keys, const std::string& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

// Keys of others are passed over, but for those that look like ours.
void check_keys(const YamlReader& file) {
  for (const auto& [key, value] : file.items()) {
    if (holds(kKeysOfOurs, key))
      value.fail("a camera file has either camera_matrix or fx, fy, cx and cy; leave one out");
    const std::string meant = holds(kKeys, key) ? "" : did_you_mean(key, kKeys);
    if (!meant.empty()) throw InputError(value.where() + ": unknown key \"" + excerpt(key) + "\"" + meant);
  }
  for (const char* key : {"image_width", "image_height", "camera_matrix"})
    file.at(key, "; a calibration needs image_width, image_height and camera_matrix");
}

// The numbers of a matrix, `rows` and `columns` of it where they are not 0.
std::vector<double> numbers_of(const YamlReader& matrix, int rows, int columns) {
  const std::string remedy = "; a matrix has rows, cols and data";
  std::vector<double> numbers;
  const std::vector<YamlReader> data = matrix.at("data", remedy).list();
  if (data.size() > kMaxNumbers) matrix.fail(fmt::format("{} numbers are too many", data.size()));
  for (const YamlReader& number : data) numbers.push_back(number.number());
  double size = 1;
  for (const auto& [side, wanted] : {std::pair{"rows", rows}, std::pair{"cols", columns}}) {
    const double told = matrix.at(side, remedy).number();
    if (wanted != 0 && told != wanted) matrix.fail(fmt::format("{} are {:g}; {} expected", side, told, wanted));
    size *= told;
  }
  if (size != static_cast<double>(numbers.size()))
    matrix.fail(fmt::format("holds {} numbers, and its rows and cols say {:g}", numbers.size(), size));
  return numbers;
}

void read_lens(const YamlReader& file, Camera& camera) {
  const YamlReader matrix = file.at("camera_matrix");
  const std::vector<double> m = numbers_of(matrix, 3, 3);
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
    matrix.fail("must be fx, 0, cx, 0, fy, cy, 0, 0, 1, by rows");
  camera.fx = m[0], camera.fy = m[4], camera.cx = m[2], camera.cy = m[5];
  camera.check();  // before its rays are looked at
  std::string model;
  file.read("distortion_model", &model);
  if (!file.has("distortion_coefficients")) {
    if (!model.empty()) file.at("distortion_model").fail("has no distortion_coefficients");
    return;
  }
  const YamlReader coefficients = file.at("distortion_coefficients");
  const std::vector<double> d = numbers_of(coefficients, 0, 0);
  try {
    camera.set_distortion(model.empty() && d.size() > 5 ? "rational_polynomial" : model, d);
  } catch (const InputError& e) {
    coefficients.fail(std::string(e.what()) + "; rectify the images, and give the camera of those");
  }
}

}  // namespace

std::shared_ptr<const GreyImage> read_camera_mask(const std::string& value, const std::string& where,
                                                  const std::string& name) {
  if (value.empty()) throw InputError(where + ": mask: has no value; it must be an image file, or leave it out");
  try {
    return std::make_shared<const GreyImage>(read_mask(std::filesystem::path(name).parent_path() / value));
  } catch (const InputError& e) {
    throw InputError(where + ": mask: " + e.what());
  }
}

bool is_calibration(const std::string& text) {
  for (const char* key : {"image_width", "camera_matrix"}) {
    const std::string line = std::string(key) + ":";
    if (text.starts_with(line) || text.find("\n" + line) != std::string::npos) return true;
  }
  return false;
}

Calibration parse_calibration(const std::string& text, const std::string& name) {
  // OpenCV's own spelling of a first line would be no YAML.
  const YamlReader file(text.starts_with("%YAML:1.0") ? "#" + text.substr(1) : text, name);
  check_keys(file);
  Calibration read;
  Camera& camera = read.camera;
  file.read("image_width", &camera.width, kSides);
  file.read("image_height", &camera.height, kSides);
  read.depth_assumed = !file.has("depth_factor");
  camera.depth_factor = kMillimetres;
  for (const auto& [key, field] :
       {std::pair{"depth_factor", &camera.depth_factor}, std::pair{"fps", &camera.fps},
        std::pair{"readout", &camera.readout}, std::pair{"depth_time_offset", &camera.depth_time_offset},
        std::pair{"depth_min", &camera.depth_min}, std::pair{"depth_max", &camera.depth_max}})
    file.read(key, field);
  if (file.has("mask")) camera.mask = read_camera_mask(file.at("mask").text(), file.at("mask").where(), name);
  try {
    read_lens(file, camera);
    camera.check();
  } catch (const InvalidOption& e) {
    const std::string message = e.what(), key = message.substr(0, message.find(':'));
    throw InputError((file.has(key) ? file.at(key).where() : name) + ": " + message);
  }
  return read;
}

}  // namespace dkb
