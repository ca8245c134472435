// SPDX-License-Identifier: Apache-2.0
/// \file
/// What may move: the interface for detectors of one's own, and those that come with the library.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

/// One object that may move.
struct Detection {
  std::string class_name;  ///< "person"
  Box box;                 ///< clipped to the image when it reaches beyond; left out when it lies outside
  float score = 1;         ///< 0 ... 1
  bool operator==(const Detection&) const = default;
};

/// What a detector says of one image: boxes, a mask, or both.
struct Detections {
  std::vector<Detection> boxes;  ///< what of a box belongs to the object is found by depth
  GreyImage mask;  ///< empty = none given; else of the image's size, 255 = on something that moves, 0 = not
  bool operator==(const Detections&) const = default;
};

/// What a detector is shown. The views are valid during the call.
struct DetectorInput {
  int64_t stamp_ns = 0;  ///< of the colour image
  ImageView colour;      ///< rgb8; empty for grey cameras
  ImageView grey;        ///< grey8
  ImageView depth;       ///< depth_f32
};

/// Finds what may move in an image. Derive from it to plug in a detector of your own; it may be slow.
/// One thread at a time calls an instance: the feeding thread when it is prompt, one of the library's when it is slow.
/// Runs are repeatable as far as the same images in the same order give the same detections.
/// Boxes outside the image and masks of another size are left out with a warning; an answer that loses all has failed.
class DKB_SLAM_API Detector {
 public:
  virtual ~Detector() = default;
  /// Looks at one image. What it throws becomes a warning, and tracking goes on by motion, without an answer; one that
  /// threw ten times in a row is not asked again until Slam::reset().
  virtual Detections detect(const DetectorInput& image) = 0;
  /// "yolo", "file" ...: as written to statistics.
  virtual std::string kind() const = 0;
  /// The next image is of another time or place: Slam was made, reset or given a map.
  virtual void reset() {}
};

/// When a slow detector is asked, and when its answer counts. In frames, so that runs do not depend on a clock.
struct DKB_SLAM_API DetectionSchedule {
  int every = 3;       ///< [frames] from one image to the next, >= 1
  int latency = 3;     ///< [frames] until an answer is used, >= 0; should cover the detector's p95 at the camera's rate
  void check() const;  ///< throws InvalidOption
};

/// The detectors of one system.
struct DKB_SLAM_API Detectors {
  bool motion = true;                             ///< what moves against the still world, by depth; needs no model
  std::vector<std::shared_ptr<Detector>> prompt;  ///< asked for every frame, on the feeding thread
  std::shared_ptr<Detector> slow;                 ///< asked on a thread of its own; its boxes and masks are carried
  DetectionSchedule schedule;                     ///< of the slow one
  std::string inference;                          ///< what computes its network: "onnxruntime", "opencv"; else empty

  /// Without the motion segmentation.
  static Detectors none();
};

/// What the command line's detector options say; a file that is not named is not used.
struct DetectorChoice {
  std::string kinds = "auto";      ///< auto, yolo (or network), motion, file, none, exec:COMMAND (last); joined by +
  std::filesystem::path model;     ///< ONNX file of the yolo kind; empty = that of $DKB_SLAM_MODEL
  std::filesystem::path labels;    ///< its class names, one per line; default: the 80 of COCO
  std::string classes;             ///< those of them that may move, by comma; default: people and what they handle
  std::filesystem::path boxes;     ///< of the file kind: `stamp class x y w h [score]` per line
  std::filesystem::path masks;     ///< folder of STAMP.png, above 0 = mover; stamps in seconds
  std::vector<int64_t> stamps_ns;  ///< of the images to come, where known: the masks' are held against them
  int every = 0, latency = 0;      ///< [frames] the network's DetectionSchedule; 0 = by its size and what computes it
  /// What computes it: "onnxruntime", "opencv", or "auto": ONNX Runtime where its library is found, else OpenCV. The
  /// environment variable DKB_ONNXRUNTIME names that library or its folder.
  std::string inference = "auto";
};

/// The detectors of that choice. What computes a network is loaded when the first one is made.
/// Throws InputError naming the file or option.
DKB_SLAM_API Detectors make_detectors(const DetectorChoice& choice, const Camera& camera);

}  // namespace dkb
