// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/movers_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"
#include "dkb/util/text_rows.h"

namespace dkb {
namespace {

constexpr std::string_view kHeader =
    "timestamp,id,class,x,y,z,vx,vy,vz,position_sd,box_x,box_y,box_w,box_h,velocity_sd";
constexpr std::string_view kHeaderBefore = kHeader.substr(0, kHeader.rfind(','));  // of 0.2.0, and of the simulator
constexpr std::array<const char*, 15> kColumns{"timestamp", "id",    "class", "x",     "y",
                                               "z",         "vx",    "vy",    "vz",    "position_sd",
                                               "box_x",     "box_y", "box_w", "box_h", "velocity_sd"};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> columns;
  for (;;) {
    const size_t comma = line.find(',');
    columns.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return columns;
    line.remove_prefix(comma + 1);
  }
}

double number(const std::vector<std::string_view>& columns, size_t column, const std::string& place) {
  return read_number(columns[column], place, kColumns[column], 1e12);
}

MoverRow parse_row(const std::vector<std::string_view>& columns, const std::string& place, std::string_view header) {
  const auto expected = static_cast<size_t>(std::count(header.begin(), header.end(), ',')) + 1;
  if (columns.size() != expected)
    throw InputError(place + fmt::format(": {} of {} columns; a row must be `{}`", columns.size(), expected, header));
  MoverRow row;
  Mover& m = row.mover;
  row.timestamp = number(columns, 0, place);
  row.stamp = std::string(columns[0]);
  int64_t id = 0;
  if (!parse_number(columns[1], &id) || id < 1 || id > std::numeric_limits<int>::max())
    throw InputError(place + ": id \"" + excerpt(columns[1]) + "\" is not a whole number from 1");
  m.id = static_cast<int>(id);
  m.class_name = std::string(columns[2]);
  if (m.class_name.empty()) throw InputError(place + ": the class is empty; it must name what moves, e.g. person");
  for (int i = 0; i < 3; ++i) {
    m.position_in_world[i] = number(columns, 3 + static_cast<size_t>(i), place);
    m.velocity_in_world[i] = number(columns, 6 + static_cast<size_t>(i), place);
  }
  m.position_sd = number(columns, 9, place);
  const auto pixels = [&](size_t column) { return static_cast<float>(number(columns, column, place)); };
  m.box = {pixels(10), pixels(11), pixels(12), pixels(13)};
  double velocity_sd = 0;
  if (columns.size() > 14) velocity_sd = number(columns, 14, place);
  m.covariance.bottomRightCorner<3, 3>().diagonal().setConstant(velocity_sd * velocity_sd);
  if (m.position_sd < 0)
    throw InputError(place + ": position_sd " + excerpt(columns[9]) + " is negative; it must be at least 0");
  if (velocity_sd < 0)
    throw InputError(place + ": velocity_sd " + excerpt(columns[14]) + " is negative; it must be at least 0");
  if (m.box.w < 0 || m.box.h < 0)
    throw InputError(place + ": the box is " + excerpt(columns[12]) + " x " + excerpt(columns[13]) +
                     " px; its size must be at least 0");
  return row;
}

}  // namespace

double velocity_sd(const Mover& mover) {
  return std::sqrt(mover.covariance.bottomRightCorner<3, 3>().trace() / 3);
}

std::string written_class(std::string name) {
  if (name.empty()) return "object";
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c <= 0x20 || c == ',' || c == '"' || c == 0x7F; }, '_');
  return name;
}

std::string movers_to_csv(const MoverRows& rows) {
  std::string out(kHeader);
  out += '\n';
  for (const MoverRow& row : rows) {
    const Mover& m = row.mover;
    const Eigen::Vector3d &p = m.position_in_world, &v = m.velocity_in_world;
    out += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.2f},{:.2f},{:.2f},{:.2f},{:.4f}\n",
                       row.stamp, m.id, written_class(m.class_name), p.x(), p.y(), p.z(), v.x(), v.y(), v.z(),
                       m.position_sd, m.box.x, m.box.y, m.box.w, m.box.h, velocity_sd(m));
  }
  return out;
}

MoverRows parse_movers(std::string_view text, const std::string& name) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  MoverRows rows;
  std::set<int> ids_of_frame;
  std::string_view header;
  for (size_t line_number = 1; !text.empty(); ++line_number) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (line.empty()) continue;
    const std::string place = name + ":" + std::to_string(line_number);
    if (header.empty()) {
      if (line != kHeader && line != kHeaderBefore)
        throw InputError(place + ": the header is \"" + excerpt(line) + "\"; it must be `" + std::string(kHeader) +
                         "`");
      header = line;
      continue;
    }
    MoverRow row = parse_row(split(line), place, header);
    if (!rows.empty() && row.timestamp < rows.back().timestamp)
      throw InputError(place + ": timestamp " + row.stamp + " is before that of the line above (" + rows.back().stamp +
                       "); sort the file by time");
    if (rows.empty() || row.timestamp > rows.back().timestamp) ids_of_frame.clear();
    if (!ids_of_frame.insert(row.mover.id).second)
      throw InputError(place + ": id " + std::to_string(row.mover.id) + " stands twice at " + row.stamp +
                       "; a mover has one line per frame");
    rows.push_back(std::move(row));
  }
  if (header.empty())
    throw InputError(name + ":1: the file is empty; its first line must be `" + std::string(kHeader) + "`");
  return rows;
}

MoverRows read_movers(const std::filesystem::path& path) {
  return parse_movers(read_file(path), path.string());
}

}  // namespace dkb
