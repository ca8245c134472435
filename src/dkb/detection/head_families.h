// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "dkb/detection/detector_heads.h"

namespace dkb {

// The families of heads, for the table of all.
std::vector<const DetectorHead*> yolo_heads();          // YOLOv5, YOLOX, YOLOv8 and its masks
std::vector<const DetectorHead*> distribution_heads();  // NanoDet-Plus, PicoDet
std::vector<const DetectorHead*> detr_heads();          // RF-DETR, D-FINE, RT-DETR

// Whether these are an output's dimensions; -1 stands for any.
bool has_dims(const OnnxNetwork::Output& output, std::span<const int> dims);
inline bool has_dims(const OnnxNetwork::Output& output, std::initializer_list<int> dims) {
  return has_dims(output, std::span(dims.begin(), dims.size()));
}
// The place of the first output of this name, or of these dimensions.
std::optional<size_t> output_named(NetworkOutputs outputs, const char* name);
std::optional<size_t> output_of_dims(NetworkOutputs outputs, std::initializer_list<int> dims);

// Appends a prediction whose numbers are finite and whose box is not empty.
inline void keep(const Prediction& p, std::vector<Prediction>* out) {
  const bool finite = std::isfinite(p.box.x) && std::isfinite(p.box.y) && std::isfinite(p.box.w) &&
                      std::isfinite(p.box.h) && std::isfinite(p.score);
  if (finite && p.box.w > 0 && p.box.h > 0) out->push_back(p);
}

inline Box box_about(float cx, float cy, float w, float h) {
  return {cx - w / 2, cy - h / 2, w, h};
}
inline Box box_between(float left, float top, float right, float bottom) {
  return {left, top, right - left, bottom - top};
}

}  // namespace dkb
