// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/layout_cameras.h"

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "dkb/util/text_rows.h"

namespace dkb {
namespace {

using Json = nlohmann::json;

const CameraModel& checked(const CameraModel& camera, const std::string& name) {
  try {
    camera.check();
  } catch (const InvalidOption& e) {
    throw InputError(name + ": " + e.what());
  }
  return camera;
}

Json parse_json(std::string_view text, const std::string& name) {
  Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) throw InputError(name + ": is no valid JSON; give --camera FILE or mend the file");
  return json;
}

const Json& member(const Json& object, const std::string& key, const std::string& name) {
  if (!object.is_object() || !object.contains(key))
    throw InputError(name + ": key \"" + key + "\" is missing; give --camera FILE or mend the file");
  return object.at(key);
}

double number(const Json& value, const std::string& what, const std::string& name) {
  if (!value.is_number()) throw InputError(name + ": " + what + " is not a number");
  return value.get<double>();
}

int side(double value, const std::string& what, const std::string& name) {
  if (!(value >= 1 && value <= 16384)) throw InputError(name + ": " + what + " must be 1 ... 16384 px");
  return static_cast<int>(value);
}

// The numbers of a text, parted by any of the given characters.
std::vector<double> numbers_in(std::string_view text, std::string_view between, const std::string& name) {
  std::vector<double> numbers;
  for (;;) {
    const size_t first = text.find_first_not_of(between);
    if (first == std::string_view::npos) return numbers;
    text.remove_prefix(first);
    const std::string_view word = text.substr(0, text.find_first_of(between));
    numbers.push_back(read_number(word, name, "intrinsic"));
    text.remove_prefix(word.size());
  }
}

// The lines of a YAML file that belong to a key at its top level.
std::string_view section_of(std::string_view text, const std::string& key) {
  const std::string start = key + ":";
  size_t at = text.starts_with(start) ? 0 : text.find("\n" + start);
  if (at == std::string_view::npos) return {};
  if (at != 0) ++at;
  text.remove_prefix(at + start.size());
  for (size_t line = text.find('\n'); line != std::string_view::npos; line = text.find('\n', line + 1))
    if (line + 1 < text.size() && std::string_view(" \t\r\n#").find(text[line + 1]) == std::string_view::npos)
      return text.substr(0, line);
  return text;
}

// What follows `key:` in a section, up to the end of the line, or for a list in brackets what stands in them.
std::string_view value_of(std::string_view section, const std::string& key, const std::string& name) {
  const std::string start = key + ":";
  size_t at = 0;
  while ((at = section.find(start, at)) != std::string_view::npos &&
         (at == 0 || std::string_view(" \t\n").find(section[at - 1]) == std::string_view::npos))
    ++at;
  if (at == std::string_view::npos)
    throw InputError(name + ": key \"" + key + "\" of d400_color_optical_frame is missing; give --camera FILE");
  std::string_view value = section.substr(at + start.size());
  value.remove_prefix(std::min(value.find_first_not_of(" \t"), value.size()));
  if (value.starts_with('[')) return value.substr(1, value.find(']') - 1);
  return value.substr(0, value.find_first_of(" \t\r\n#"));
}

}  // namespace

CameraModel parse_intrinsic_matrix(std::string_view text, const std::string& name, int width, int height) {
  std::vector<std::vector<double>> rows;
  for_each_row(text, name, [&](const std::string& place, const std::vector<std::string_view>& columns) {
    if (columns.size() < 3)
      throw InputError(place + ": " + std::to_string(columns.size()) + " of 3 columns; the file must hold a matrix");
    rows.emplace_back();
    for (const std::string_view column : columns) rows.back().push_back(read_number(column, place, "intrinsic"));
  });
  if (rows.size() < 3) throw InputError(name + ": holds " + std::to_string(rows.size()) + " of 3 rows of a matrix");
  CameraModel camera;
  camera.width = width, camera.height = height;
  camera.fx = rows[0][0], camera.fy = rows[1][1], camera.cx = rows[0][2], camera.cy = rows[1][2];
  camera.depth_factor = kMillimetres;
  return checked(camera, name);
}

CameraModel parse_replica_camera(std::string_view text, const std::string& name) {
  const Json json = parse_json(text, name);
  const Json& c = member(json, "camera", name);
  const auto read = [&](const std::string& key) { return number(member(c, key, name), key, name); };
  CameraModel camera;
  camera.width = side(read("w"), "w", name), camera.height = side(read("h"), "h", name);
  camera.fx = read("fx"), camera.fy = read("fy"), camera.cx = read("cx"), camera.cy = read("cy");
  camera.depth_factor = read("scale");
  return checked(camera, name);
}

CameraModel parse_open3d_camera(std::string_view text, const std::string& name) {
  const Json json = parse_json(text, name);
  const Json& matrix = member(json, "intrinsic_matrix", name);
  if (!matrix.is_array() || matrix.size() != 9)
    throw InputError(name + ": intrinsic_matrix must be nine numbers by columns");
  std::array<double, 9> m{};
  for (size_t i = 0; i < 9; ++i) m[i] = number(matrix[i], "intrinsic_matrix", name);
  CameraModel camera;
  camera.width = side(number(member(json, "width", name), "width", name), "width", name);
  camera.height = side(number(member(json, "height", name), "height", name), "height", name);
  camera.fx = m[0], camera.fy = m[4], camera.cx = m[6], camera.cy = m[7];
  camera.depth_factor = kMillimetres;
  return checked(camera, name);
}

CameraModel parse_openloris_camera(std::string_view text, const std::string& name) {
  const std::string_view section = section_of(text, "d400_color_optical_frame");
  if (section.empty()) throw InputError(name + ": holds no d400_color_optical_frame; give --camera FILE");
  CameraModel camera;
  camera.width = side(read_number(value_of(section, "width", name), name, "width"), "width", name);
  camera.height = side(read_number(value_of(section, "height", name), name, "height"), "height", name);
  const std::vector<double> m = numbers_in(value_of(section, "data", name), " \t\r\n,", name);
  if (m.size() != 4) throw InputError(name + ": intrinsics of d400_color_optical_frame must be fx, cx, fy, cy");
  camera.fx = m[0], camera.cx = m[1], camera.fy = m[2], camera.cy = m[3];
  camera.depth_factor = kMillimetres;
  return checked(camera, name);
}

CameraModel resized(const CameraModel& camera, int width, int height) {
  CameraModel result = camera;
  const double sx = static_cast<double>(width) / camera.width, sy = static_cast<double>(height) / camera.height;
  result.width = width, result.height = height;
  result.fx = camera.fx * sx, result.cx = (camera.cx + 0.5) * sx - 0.5;
  result.fy = camera.fy * sy, result.cy = (camera.cy + 0.5) * sy - 0.5;
  return result;
}

}  // namespace dkb
