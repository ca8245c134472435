// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/fixed_text.h"
#include "dkb/util/stamps.h"
#include "dkb/util/text_rows.h"
#include "dkb_slam/slam.h"

namespace dkb {
namespace {

constexpr double kUnitTolerance = 1e-2;  // of a quaternion's length; two decimals leave it so
constexpr const char* kRow = "`timestamp tx ty tz qx qy qz qw`";

// Throws unless these are the columns of a row.
void check_columns(const std::vector<std::string_view>& columns, const std::string& place) {
  constexpr size_t kKitti = 12;
  const size_t n = columns.size();
  if (n == 8) return;
  if (n < 8 && std::ranges::any_of(columns, [](auto c) { return c.find(',') != c.npos; }))
    throw InputError(place + ": commas separate the columns; spaces must: " + kRow);
  if (n == kKitti)
    throw InputError(place + ": 12 numbers a row, as in a KITTI file: it has no stamps; give a file with rows " + kRow);
  throw InputError(place + ": " + std::to_string(n) + (n < 8 ? " of 8 columns" : " columns, not 8") +
                   "; a row must be " + kRow);
}

bool is_nan(std::string_view number) {
  const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
  if (!number.empty() && number[0] == '-') number.remove_prefix(1);
  return std::ranges::equal(number, std::string_view("nan"), same);
}

}  // namespace

Trajectory read_trajectory(const std::filesystem::path& path) {
  return parse_trajectory(read_file(path), path.string());
}

Trajectory read_truth(const std::filesystem::path& path, size_t* hidden) {
  size_t ignored = 0;
  return parse_trajectory(read_file(path), path.string(), hidden != nullptr ? hidden : &ignored);
}

std::string hidden_text(size_t rows) {
  return fmt::format("{} rows with nan are left out", rows);
}

std::optional<Trajectory> truth_beside(const std::filesystem::path& recording, size_t* hidden) {
  const std::filesystem::path file = recording / "groundtruth.txt";
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return std::nullopt;
  return read_truth(file, hidden);
}

Trajectory parse_trajectory(const std::string& text, const std::string& name, size_t* hidden) {
  Trajectory trajectory;
  for_each_row(text, name, [&](const std::string& place, std::vector<std::string_view> columns) {
    // A remark may end a row.
    columns.erase(std::ranges::find_if(columns, [](auto c) { return c.starts_with('#'); }), columns.end());
    check_columns(columns, place);
    static constexpr const char* kNames[] = {"timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};
    if (hidden != nullptr && std::any_of(columns.begin() + 1, columns.begin() + 8, is_nan)) {
      ++*hidden;
      return;
    }
    double v[8];
    for (size_t i = 0; i < 8; ++i) v[i] = read_number(columns[i], place, kNames[i]);
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    const double norm = q.norm();
    if (!(std::abs(norm - 1) <= kUnitTolerance))
      throw InputError(
          fmt::format("{}: the quaternion is of length {:.4g}, not 1; a row must be {}", place, norm, kRow));
    // Nine decimals leave a norm of 1 +- 1e-9: such a quaternion stays as it is written, to be written the same again.
    const Eigen::Quaterniond unit = std::abs(norm - 1) <= 1e-9 ? q : Eigen::Quaterniond(q.coeffs() / norm);
    trajectory.push_back({v[0], std::string(columns[0]), Rigid3(unit, {v[1], v[2], v[3]})});
  });
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.timestamp < b.timestamp; });
  return trajectory;
}

std::string trajectory_to_text(const Trajectory& trajectory) {
  std::string out = "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    Eigen::Vector4d q = pose.world_from_cam.rotation.coeffs();  // x, y, z, w
    if (q.w() < 0) q = -q;
    out += pose.stamp.empty() ? fmt::format("{:.6f}", pose.timestamp) : pose.stamp;
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) out += ' ' + fixed_text(value, 9);
    out += '\n';
  }
  return out;
}

void write_trajectory(const std::filesystem::path& path, const Trajectory& trajectory) {
  write_file_atomically(path, trajectory_to_text(trajectory));
}

std::vector<Trajectory> trajectories_by_map(const std::vector<TrajectoryFrame>& frames,
                                            const std::vector<std::string>& stamps) {
  std::vector<Trajectory> by_map(1);
  for (const TrajectoryFrame& f : frames) {
    const auto map = static_cast<size_t>(f.map);
    if (by_map.size() <= map) by_map.resize(map + 1);
    const bool known = f.frame >= 0 && !stamps.empty();
    by_map[map].push_back({seconds_from_ns(f.stamp_ns),
                           known          ? stamps.at(static_cast<size_t>(f.frame))
                           : f.frame >= 0 ? stamp_text(f.stamp_ns)
                                          : "",
                           f.world_from_cam});
  }
  const auto earlier = [](const StampedPose& a, const StampedPose& b) { return a.timestamp < b.timestamp; };
  for (Trajectory& t : by_map) std::stable_sort(t.begin(), t.end(), earlier);
  return by_map;
}

}  // namespace dkb
