// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/detection/detector_heads.h"
#include "dkb/detection/onnx_network.h"

namespace dkb {

// People, and what they carry, ride, lead or push, by their COCO names. Furniture is left out, since nearly always it
// stands still; a chair that is pushed is found by motion.
inline constexpr const char* kMovableClasses =
    "person,bicycle,cat,dog,backpack,umbrella,handbag,suitcase,frisbee,sports ball,skateboard,tennis racket,cell phone";

struct OnnxOptions {
  std::filesystem::path model;            // ONNX file
  std::filesystem::path labels;           // class names, one per line, in the graph's order; empty = COCO's
  std::string classes = kMovableClasses;  // classes that may move, by comma
  Inference inference = Inference::automatic;
};

// Detector `yolo`, alias `network`: an ONNX graph with one of detector_heads(), told by its outputs, whose masks go
// along with its boxes. It is run on one core by ONNX Runtime or by OpenCV's DNN module: whichever it is, it is loaded
// with the first such detector and costs nothing before. Note: with OpenCV it sets that library's process-wide thread
// count to 1 and silences its log, so that runs are repeatable.
class OnnxDetector final : public Detector {
 public:
  // `width` x `height` [px]: size of the images to come; a graph with open input size gets their shape, in the size
  // that is usual for its head (DetectorHead::usual_input). Throws InputError, one line naming the file, when the model
  // is missing, truncated or no ONNX, when one of its layers cannot be run (named), when it has no known head, when
  // labels do not match it, and when nothing is here that runs networks.
  OnnxDetector(const OnnxOptions& options, int width, int height);

  // Throws InputError for an image without pixels and when the network fails.
  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "yolo"; }

  // [frames] from one image that is looked at to the next, and until its answer counts, where the user names none. By
  // the time that a detection takes on one core of a desktop computer, estimated from the sizes of the file and of the
  // input and from what computes it, so that runs do not depend on the machine. One frame, where two thirds of
  // a frame's time are enough. YOLOv5n takes 10 ms at 320 x 256 and 32 ms at 640 x 480 by ONNX Runtime (1 and 3
  // frames), YOLOX-nano 18 ms at 416 x 416 (1). By OpenCV they take 34, 95 and 70 ms (3, 6 and 4).
  int frames_per_detection(double frames_per_second) const;

  int input_width() const { return input_width_; }    // [px] of the network
  int input_height() const { return input_height_; }  // [px]
  const DetectorHead& head() const { return *layout_.head; }
  Inference inference() const { return network_->inference(); }  // never `automatic`

 private:
  OnnxOptions options_;
  size_t model_bytes_ = 0;
  int input_width_ = 0, input_height_ = 0;
  HeadLayout layout_;
  std::vector<std::string> labels_;
  Wanted wanted_;
  std::unique_ptr<OnnxNetwork> network_;
  std::vector<float> blob_;
};

// The names of the 80 COCO classes in the order nearly all networks use; by COCO's own numbers, 0 ... 90, of which some
// name nothing.
std::vector<std::string> coco_labels();
std::vector<std::string> numbered_coco_labels();

}  // namespace dkb
