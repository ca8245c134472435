// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/detection/onnx_graph_test_util.h"
#include "dkb/detection/onnx_network.h"

// Small outputs of every known head but for the first YOLOs, each with one person, with COCO's classes.
namespace dkb::head_test {
using onnx_test::Put;

constexpr int kPerson = 0, kPersonOfCoco = 1;  // COCO itself counts its classes from 1

struct Sample {
  std::string head;
  int width, height;  // [px] of the input
  std::vector<Put> outputs;
};

// The outputs as a network would give them for a black image; `outputs` must live on.
inline std::vector<OnnxNetwork::Output> as_network_outputs(const std::vector<Put>& outputs) {
  std::vector<OnnxNetwork::Output> out;
  for (const Put& put : outputs) out.push_back({put.name, put.dims, put.bias});
  return out;
}

// Writes a side's distribution over 0 ... 7 whose mean is `strides`, all on one place or half on each of two.
inline void set_side(float* logits, float strides) {
  logits[static_cast<int>(strides)] = 50;
  if (strides != static_cast<float>(static_cast<int>(strides))) logits[static_cast<int>(strides) + 1] = 50;
}

// 64 x 64: 64 + 16 + 4 + 1 cells. A person in cell (1, 2) of stride 16: from its corner, (16, 32), one stride to the
// left, two to the right, one and a half down. The score is 0.4 times the mean of the first channel.
inline Sample nanodet_plus() {
  Put out("output", {1, 85, 80 + 32});
  const int cell = 64 + 2 * 4 + 1;
  out.slope[0][out.at({0, cell, kPerson})] = 0.4f;
  const float sides[] = {1, 0, 2, 1.5f};
  for (int k = 0; k < 4; ++k) set_side(&out({0, cell, 80 + 8 * k}), sides[k]);
  return {"NanoDet-Plus", 64, 64, {out}};
}

// A person in cell (3, 1) of stride 8: from its centre, (28, 12), one stride to the left and up, two to the right and
// down. The score is 0.4 times the mean of the first channel.
inline Sample picodet() {
  Sample sample{"PicoDet", 64, 64, {}};
  for (const int cells : {64, 16, 4, 1})
    sample.outputs.emplace_back("scores" + std::to_string(cells), std::vector{1, cells, 80});
  for (const int cells : {64, 16, 4, 1})
    sample.outputs.emplace_back("sides" + std::to_string(cells), std::vector{1, cells, 32});
  Put &scores = sample.outputs[0], &sides = sample.outputs[4];
  scores.slope[0][scores.at({0, 8 + 3, kPerson})] = 0.4f;
  for (int k = 0; k < 4; ++k) set_side(&sides({0, 8 + 3, 8 * k}), k < 2 ? 1 : 2);
  return sample;
}

// The person that picodet() has, as a box.
inline Sample picodet_boxes() {
  Put boxes("boxes", {1, 85, 4}), scores("scores", {1, 80, 85});
  const float corners[] = {20, 4, 44, 28};
  for (int k = 0; k < 4; ++k) boxes({0, 11, k}) = corners[k];
  scores.slope[0][scores.at({0, kPerson, 11})] = 0.4f;
  return {"PicoDet without NMS", 64, 64, {boxes, scores}};
}

// 96 x 64: 126 cells. A person from (16, 16) to (80, 48), whose mask is the left half of the image, up to x = 48: its
// one coefficient is 2, the prototype 1 left of there and -1 right of it. The score is the mean of the first channel.
inline Sample yolov8_seg() {
  Put out("output0", {1, 4 + 80 + 32, 126}), prototypes("output1", {1, 32, 16, 24});
  const float box[] = {48, 32, 64, 32};
  for (int k = 0; k < 4; ++k) out({0, k, 5}) = box[k];
  out.slope[0][out.at({0, 4 + kPerson, 5})] = 1;
  out({0, 4 + 80 + 3, 5}) = 2;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 24; ++x) prototypes({0, 3, y, x}) = x < 12 ? 1.0f : -1.0f;
  return {"YOLOv8-seg", 96, 64, {out, prototypes}};
}

// Makes the prediction `at` of a transformer a person about the middle of the input's upper half, half as wide and a
// quarter as high as the input, whose score is the sigmoid of the mean of the first channel; the others nothing.
inline void set_person(int at, int class_id, Put& boxes, Put& logits) {
  const float box[] = {0.5f, 0.25f, 0.5f, 0.25f};
  for (int k = 0; k < 4; ++k) boxes({0, at, k}) = box[k];
  for (float& logit : logits.bias) logit = -9;
  logits({0, at, class_id}) = 0;
  logits.slope[0][logits.at({0, at, class_id})] = 1;
}

// 56 x 56, no multiple of 32: a person about (28, 14), 28 wide and 14 high.
inline Sample rf_detr() {
  Put boxes("dets", {1, 3, 4}), logits("labels", {1, 3, 91});
  set_person(1, kPersonOfCoco, boxes, logits);
  return {"RF-DETR", 56, 56, {boxes, logits}};
}

// The same with a mask: above 0 in the lower half of all of the input.
inline Sample rf_detr_seg() {
  Sample sample = rf_detr();
  sample.head = "RF-DETR-Seg";
  Put masks("masks", {1, 3, 14, 14});
  for (int y = 0; y < 14; ++y)
    for (int x = 0; x < 14; ++x) masks({0, 1, y, x}) = y < 3 ? -1.0f : 1.0f;
  sample.outputs.push_back(masks);
  return sample;
}

// At 64 x 64 and with 80 classes.
inline Sample d_fine() {
  Put logits("logits", {1, 3, 80}), boxes("pred_boxes", {1, 3, 4});
  set_person(2, kPerson, boxes, logits);
  return {"D-FINE or RT-DETR", 64, 64, {logits, boxes}};
}

// Scored: a bicycle and a person from (16, 8) to (48, 24), whose score is the mean of the first channel.
inline Sample scored_boxes() {
  Put labels("labels", {1, 2}), boxes("boxes", {1, 2, 4}), scores("scores", {1, 2});
  labels.bias = {1, 0};
  labels.integers = true;
  boxes.bias = {0, 0, 5, 5, 16, 8, 48, 24};
  scores.bias = {0.1f, 0};
  scores.slope[0][1] = 1;
  return {"D-FINE or RT-DETR, scored", 64, 64, {labels, boxes, scores}};
}

inline std::vector<Sample> samples() {
  return {nanodet_plus(), picodet(), picodet_boxes(), yolov8_seg(), rf_detr(), rf_detr_seg(), d_fine(), scored_boxes()};
}

}  // namespace dkb::head_test
