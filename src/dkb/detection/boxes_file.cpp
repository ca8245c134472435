// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/boxes_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"
#include "dkb/util/text_rows.h"

namespace dkb {
namespace {

constexpr double kLimit = 1e12;  // of stamps, pixels and scores alike; floats hold more

struct Row {
  double timestamp = 0;
  bool within_one = false;  // all of its numbers are at most 1, as are shares of the image
  Detection detection;
};

Row parse_row(const std::vector<std::string_view>& columns, const std::string& place, int width, int height) {
  if (columns.size() < 6)
    throw InputError(place + ": " + std::to_string(columns.size()) +
                     " of 6 columns; a row must be `rgb_timestamp class x y w h [score]`");
  const auto number = [&](size_t column, const char* what) {
    return read_number(columns[column], place, what, kLimit);
  };
  Row row;
  row.timestamp = number(0, "timestamp");
  row.detection.class_name = std::string(columns[1]);
  const double x = number(2, "x"), y = number(3, "y"), w = number(4, "w"), h = number(5, "h");
  if (columns.size() > 6) row.detection.score = static_cast<float>(number(6, "score"));
  row.within_one = x <= 1 && y <= 1 && w <= 1 && h <= 1;
  if (!(w > 0) || !(h > 0))
    throw InputError(place + fmt::format(": the box is {} x {} px; its size must be positive", w, h));
  const Box box{static_cast<float>(x), static_cast<float>(y), static_cast<float>(w), static_cast<float>(h)};
  row.detection.box = clip(box, width, height);
  if (!(row.detection.box.w > 0) || !(row.detection.box.h > 0))
    throw InputError(place + fmt::format(": the box at ({}, {}) of {} x {} px lies wholly outside the {} x {} image; "
                                         "x and y are its top-left corner in pixels",
                                         x, y, w, h, width, height));
  return row;
}

}  // namespace

BoxesByTime parse_boxes(std::string_view text, const std::string& name, int width, int height) {
  std::vector<Row> rows;
  std::string first;  // row
  for_each_row(text, name, [&](const std::string& place, const std::vector<std::string_view>& columns) {
    rows.push_back(parse_row(columns, place, width, height));
    if (first.empty()) first = place;
  });
  if (!rows.empty() && std::all_of(rows.begin(), rows.end(), [](const Row& r) { return r.within_one; }))
    throw InputError(first +
                     ": this box and all others are within 0 ... 1; x, y, w and h are pixels: multiply x and w " +
                     "by the image's width, y and h by its height");
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.timestamp < b.timestamp; });
  BoxesByTime boxes;
  for (Row& row : rows) {
    if (boxes.empty() || boxes.back().timestamp != row.timestamp) boxes.push_back({row.timestamp, {}});
    boxes.back().boxes.push_back(std::move(row.detection));
  }
  return boxes;
}

FileDetector::FileDetector(const std::filesystem::path& path, int width, int height)
    : boxes_(parse_boxes(read_file(path), path.string(), width, height)) {}

const TimedBoxes* FileDetector::at(int64_t stamp_ns) const {
  return find_same_stamp(boxes_, seconds_from_ns(stamp_ns), [](const TimedBoxes& t) { return t.timestamp; });
}

Detections FileDetector::detect(const DetectorInput& image) {
  const TimedBoxes* nearest = at(image.stamp_ns);
  return nearest == nullptr ? Detections{} : Detections{nearest->boxes, {}};
}

}  // namespace dkb
