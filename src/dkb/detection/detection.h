// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/image/rgbd_image.h"

namespace dkb {

// Axis-aligned rectangle in pixels of the original image: x, y = top-left corner, covering [x, x + w) x [y, y + h).
struct Box {
  float x = 0, y = 0, w = 0, h = 0;

  float area() const { return w * h; }
  bool contains(float px, float py) const { return px >= x && py >= y && px < x + w && py < y + h; }
  bool operator==(const Box&) const = default;
};

// The part of `box` within an image of this size [px]; of zero width or height when there is none.
Box clip(const Box& box, int width, int height);

// Area of the intersection over area of the union, 0 ... 1; 0 for empty boxes.
float intersection_over_union(const Box& a, const Box& b);

// One object that may move.
struct Detection {
  std::string class_name;  // "person"
  Box box;
  float score = 1;  // 0 ... 1
  bool operator==(const Detection&) const = default;
};

// What a detector says of one image.
struct Detections {
  double timestamp = 0;  // [s] of the colour image
  std::vector<Detection> boxes;
  GreyImage mask;  // empty = none given; else of the image's size, 255 = on something that moves, 0 = not
  bool operator==(const Detections&) const = default;
};

// Finds what may move in an image. One instance is used by one thread at a time. Deterministic: the same images in the
// same order give the same detections. Whatever is wrong with its model or files is thrown by the constructor.
class Detector {
 public:
  virtual ~Detector() = default;
  virtual Detections detect(const RgbdImage& image) = 0;
  virtual std::string kind() const = 0;  // "yolo", "file", "masks" ...: as written to stats.json
};

}  // namespace dkb
