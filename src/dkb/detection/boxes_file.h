// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/detection/detection.h"

namespace dkb {

struct TimedBoxes {
  double timestamp = 0;  // [s] of the colour image
  std::vector<Detection> boxes;
};
// Boxes of a whole sequence by increasing time stamp, one entry per stamp; boxes of one stamp in the file's order.
using BoxesByTime = std::vector<TimedBoxes>;

// Text of rows `rgb_timestamp class x y w h [score]`: top-left corner and size in pixels. Further columns, blank lines,
// comments (#), CRLF and a byte order mark are tolerated; rows may come in any order. A missing score is 1. Boxes are
// clipped to the image. Throws InputError `name:line: ...` for too few columns, numbers that are not finite, sizes that
// are not positive, and boxes wholly outside an image of width x height [px].
BoxesByTime parse_boxes(std::string_view text, const std::string& name, int width, int height);

// The detector `file`: boxes recorded or simulated earlier. All boxes are taken, whatever the last column says. An
// image gets the boxes of the nearest stamp within 2 ms, or none.
class FileDetector final : public Detector {
 public:
  FileDetector(const std::filesystem::path& path, int width, int height);
  explicit FileDetector(BoxesByTime boxes) : boxes_(std::move(boxes)) {}

  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "file"; }
  const BoxesByTime& boxes() const { return boxes_; }
  const TimedBoxes* at(int64_t stamp_ns) const;  // those that an image of this stamp gets; may be null

 private:
  BoxesByTime boxes_;
};

}  // namespace dkb
