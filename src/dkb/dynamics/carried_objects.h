// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "dkb/detection/carried_detections.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/dynamics/silhouette.h"
#include "dkb/features/image_pyramid.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/map/ids.h"

namespace dkb {

// What is kept of a frame so that detections can be carried from it and flow measured to it.
struct PastFrame {
  FrameIndex frame = 0;
  std::shared_ptr<const RgbdImage> image;
  std::shared_ptr<const ImagePyramid> pyramid;
  std::vector<Eigen::Vector2f> corners;  // [px] of the image as read
  StillCells still;                      // when it became a keyframe; empty without motion segmentation
  bool keyframe = false;
};
using PastFrames = std::deque<PastFrame>;  // newest last

// Where movers were in an earlier keyframe, as a detection has shown since.
struct LateMask {
  FrameIndex frame = 0;
  MoverMask mask;
};

// What a slow detector has said, carried by optical flow to the newest image. Deterministic.
class CarriedObjects {
 public:
  CarriedObjects(const Camera& camera, const SensorNoise& noise) : camera_(camera), noise_(noise) {}

  // Works in what was detected in frame `from`, carried to the newest of `past`, where all objects are until follow();
  // of a frame that is not in `past`, where it was. The masks of the keyframes in `past`, which may have let movers
  // into the map, those before `from` as well: the detector's own, or else silhouettes of its boxes, without what was
  // seen to stand still.
  std::vector<LateMask> receive(FrameIndex from, const Detections& detections, const PastFrames& past);
  // One frame on, from the newest of `past` to the image of `pyramid`.
  void follow(const PastFrames& past, const ImagePyramid& pyramid);

  std::vector<Detection> boxes() const;
  std::vector<Detection> unmasked_boxes() const;   // those whose answers gave no mask with them
  const GreyImage& mask() const { return mask_; }  // of the others; empty when there are none
  // The same as what movers cover: with a rim as silhouettes have, since at its edge a carried mask is off by some
  // pixels.
  MoverMask mover_mask() const { return with_rim(mask_); }

 private:
  struct Carried {
    Detection detection;
    int missed = 0;
    bool masked = false;  // its answer gave a mask
  };
  std::vector<PointMotion> motions(const PastFrame& from, const ImagePyramid& to,
                                   const std::vector<Detection>& boxes) const;
  MoverMask with_rim(const GreyImage& mask) const;
  Detections carry_to(const PastFrame& from, const ImagePyramid& to, const Detections& detections, int frames) const;

  Camera camera_;
  SensorNoise noise_;
  std::vector<Carried> carried_;
  GreyImage mask_;
};

}  // namespace dkb
