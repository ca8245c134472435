// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/detection/yolo_heads.h"

namespace dkb {

class OnnxNetwork;

// People, and what they carry, ride, lead or push, by their COCO names. Furniture is left out, since nearly always it
// stands still; a chair that is pushed is found by motion.
inline constexpr const char* kMovableClasses =
    "person,bicycle,cat,dog,backpack,umbrella,handbag,suitcase,frisbee,sports ball,skateboard,tennis racket,cell phone";

struct OnnxOptions {
  std::filesystem::path model;            // ONNX file
  std::filesystem::path labels;           // class names, one per line, in the graph's order; empty = the 80 of COCO
  std::string classes = kMovableClasses;  // classes that may move, by comma
  // [px] longer side of the network's input, multiple of 32, <= 4096; the other side follows the images' shape. 0 = as
  // the graph says, or where it leaves the size open 416 for YOLOX and 640 for others. Many graphs run at other sizes
  // than they say; one that does not is an error.
  int input_size = 0;
  float min_score = 0.25f;  // objectness x class score that a detection must reach, in (0, 1)
  float max_overlap =
      0.45f;  // intersection over union above which the weaker of two boxes of a class is dropped, (0, 1]
  void check() const;
};

// Detector `yolo`: an ONNX graph with a YOLOv5 (v7), YOLOX or YOLOv8 (v11) head, told apart by the shape of the output,
// run on one core by OpenCV's DNN module, which is loaded with the first such detector and costs nothing before.
// Note: it sets OpenCV's process-wide thread count to 1 and silences OpenCV's log, so that runs are repeatable.
class OnnxDetector final : public Detector {
 public:
  // `width` x `height` [px]: size of the images to come; a graph with open input size gets their shape. Throws
  // InputError, one line naming the file, when the model is missing, truncated or no ONNX, when OpenCV cannot run one
  // of its layers (named), when it has no known head, when labels do not match it, and when this build has no DNN.
  OnnxDetector(const OnnxOptions& options, int width, int height);
  ~OnnxDetector() override;

  // Throws InputError for an image without pixels, and std::runtime_error when the network fails.
  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "yolo"; }

  // [frames] that one detection takes on one core of a desktop computer, estimated from the sizes of
  // the file and of the input alone, so that runs do not depend on the machine: for the schedule where the user names
  // none. YOLOv5n takes 36 ms at 320 x 256 and 141 ms at 640 x 480 (2 and 5 frames), YOLOX-nano 71 ms at 416 x 416 (3).
  int frames_per_detection(double frames_per_second) const;

  int input_width() const { return input_width_; }    // [px] of the network
  int input_height() const { return input_height_; }  // [px]
  YoloHead head() const { return head_.kind; }

 private:
  OnnxOptions options_;
  size_t model_bytes_ = 0;
  int input_width_ = 0, input_height_ = 0;
  HeadLayout head_;
  std::vector<std::string> labels_;
  std::vector<bool> movable_;  // per class
  std::unique_ptr<OnnxNetwork> network_;
  std::vector<float> blob_;
};

// Whether this build has the ONNX detector at all.
bool onnx_available();

// The names of the 80 COCO classes in the order all YOLO families use.
std::vector<std::string> coco_labels();

}  // namespace dkb
