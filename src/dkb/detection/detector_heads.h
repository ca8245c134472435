// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/detection/network_input.h"
#include "dkb/detection/onnx_network.h"

namespace dkb {

using NetworkOutputs = std::span<const OnnxNetwork::Output>;

// A decoded prediction: best class, box in pixels of the network's input.
struct Prediction {
  int class_id = 0;
  Box box;
  float score = 0;
  size_t index = 0;  // which of its head's predictions it is, where that has masks
};

// The predictions that are asked for.
struct Wanted {
  std::vector<bool> classes;  // by number
  float min_score = 0.25f;    // of objectness x class score
  bool takes(int class_id, float score) const {
    return score >= min_score && static_cast<size_t>(class_id) < classes.size() &&
           classes[static_cast<size_t>(class_id)];
  }
};

// Where an object is, over the whole of the network's input: above 0 on it.
struct MaskLogits {
  int width = 0, height = 0;
  std::vector<float> values;
};

struct DetectorHead;

// A head as a graph has it.
struct HeadLayout {
  const DetectorHead* head = nullptr;
  int classes = 0;              // that it scores; 0 = its outputs do not say
  int predictions = 0;          // an image
  std::vector<size_t> outputs;  // which of the graph's outputs it reads, in the order of its decode()
  bool operator==(const HeadLayout&) const = default;
};

// What a family of detection networks puts out, and what it wants to be given.
struct DetectorHead {
  const char* name;
  const char* outputs;  // in words; C classes, N predictions
  Preprocessing preprocessing{};
  int usual_input = 640;             // [px] of graphs that leave it open
  bool transformer = false;          // gives one box an object; graphs of open size run at a square input only
  bool numbered_as_in_coco = false;  // classes by COCO's own numbers, 1 ... 90 with gaps; the last may be no class

  // None when the outputs at this input size [px] are not this head's. Every output holds as many values as its
  // dimensions say.
  std::optional<HeadLayout> (*recognise)(NetworkOutputs outputs, int width, int height) = nullptr;
  // The predictions that are wanted, in the output's order; what is not finite is left out.
  std::vector<Prediction> (*decode)(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                    const Wanted& wanted) = nullptr;
  // Null where the head has no masks.
  MaskLogits (*mask)(const HeadLayout& layout, NetworkOutputs outputs, const Prediction& prediction) = nullptr;
};

// Every head that is known, in the order in which they are looked for.
std::span<const DetectorHead> detector_heads();

// The head of a graph with these outputs; none when no known one has them.
std::optional<HeadLayout> recognise_head(NetworkOutputs outputs, int width, int height);

// Greedy non-maximum suppression within each class: by falling score (ties in the given order) a box stays unless it
// overlaps one that stayed by more than `max_overlap` (intersection over union). The best 1000 take part.
std::vector<Prediction> suppress_overlaps(std::vector<Prediction> predictions, float max_overlap);

// Sets the pixels of `mask`, an image's, on which the object is to 255. Looks only within `box`, in the image.
void paint_mask(const MaskLogits& logits, const Letterbox& letterbox, const Box& box, GreyImage* mask);

}  // namespace dkb
