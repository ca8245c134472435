// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_detector.h"

namespace dkb {

std::vector<std::string> coco_labels() {
  return {
      "person",         "bicycle",    "car",           "motorcycle",    "airplane",     "bus",           "train",
      "truck",          "boat",       "traffic light", "fire hydrant",  "stop sign",    "parking meter", "bench",
      "bird",           "cat",        "dog",           "horse",         "sheep",        "cow",           "elephant",
      "bear",           "zebra",      "giraffe",       "backpack",      "umbrella",     "handbag",       "tie",
      "suitcase",       "frisbee",    "skis",          "snowboard",     "sports ball",  "kite",          "baseball bat",
      "baseball glove", "skateboard", "surfboard",     "tennis racket", "bottle",       "wine glass",    "cup",
      "fork",           "knife",      "spoon",         "bowl",          "banana",       "apple",         "sandwich",
      "orange",         "broccoli",   "carrot",        "hot dog",       "pizza",        "donut",         "cake",
      "chair",          "couch",      "potted plant",  "bed",           "dining table", "toilet",        "tv",
      "laptop",         "mouse",      "remote",        "keyboard",      "cell phone",   "microwave",     "oven",
      "toaster",        "sink",       "refrigerator",  "book",          "clock",        "vase",          "scissors",
      "teddy bear",     "hair drier", "toothbrush"};
}

std::vector<std::string> numbered_coco_labels() {
  std::vector<std::string> numbered(1);  // COCO counts from 1
  for (const std::string& label : coco_labels()) {
    // Numbers of COCO's 91 classes for which no image has an object marked, and which the 80 leave out.
    for (const size_t unused : {12, 26, 29, 30, 45, 66, 68, 69, 71, 83})
      if (numbered.size() == unused) numbered.emplace_back();
    numbered.push_back(label);
  }
  return numbered;
}

}  // namespace dkb
