// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/comparison/dynamic_filter.h"
#include "dkb/detection/carried_detections.h"
#include "dkb/detection/detection_thread.h"
#include "dkb/dynamics/motion_segmenter.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/dynamics/silhouette.h"
#include "dkb/features/features.h"
#include "dkb/features/optical_flow.h"
#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/map/ids.h"
#include "dkb/util/timing.h"

namespace dkb {

struct DynamicsOptions {
  FilterKind filter = FilterKind::standard;
  PaperFilterOptions paper;
  EpipolarFilterOptions epipolar;
  MultiviewFilterOptions multiview;
  SilhouetteOptions silhouette;
  MotionOptions motion;
  OpticalFlowOptions flow;
  CarryOptions carry;
  int support_cell = 4;     // [px] cells of the motion segmentation when it only supports another detector, 2 ... 32
  int points_per_box = 40;  // features followed to carry a box, >= 4
  int missed_results = 2;   // detector results that may miss an object before its box is dropped, >= 0
  void check() const;
};

// The detectors of a system; by default none.
struct DetectorSet {
  std::unique_ptr<Detector> slow;                 // with a thread and a latency of its own (networks)
  DetectionSchedule schedule;                     // of the slow one
  std::vector<std::unique_ptr<Detector>> prompt;  // answer at once (files)
  bool motion = false;                            // the built-in motion segmentation
};

// What is known of movers in the current image.
struct DynamicScene {
  std::vector<uint8_t> dynamic;  // per corner: 1 = must not be used
  std::vector<Detection> boxes;  // in the current image
  MoverMask mask;                // where movers are (filter `standard` only)
};

// A silhouette that came too late for the frame it belongs to.
struct LateMask {
  FrameIndex frame = 0;
  MoverMask mask;
};

// The filter stage (DKB section 3.1): detections made beside tracking are carried to the current image by flow; the
// chosen filter then says which corners move. Deterministic.
class DynamicStage {
 public:
  DynamicStage(const CameraModel& camera, const DynamicsOptions& options, DetectorSet detectors);

  // What tracking knows before it looks at the frame.
  struct Context {
    FrameIndex frame = 0;
    std::shared_ptr<const RgbdImage> image;
    const OrbFeatures* orb = nullptr;
    const UndistortionTable* undistort = nullptr;
    Rigid3 current_from_previous;  // expected motion of the camera
    Rigid3 cam_from_world;         // expected pose
    std::vector<Eigen::Vector3d>
        keyframe_points_in_camera;  // for `multiview`: points of earlier keyframes, expected pose
  };
  // Hands the image to the detector and waits for what is due at this frame (a real-time run waits only for the first).
  void begin_frame(FrameIndex frame, std::shared_ptr<const RgbdImage> image);
  DynamicScene process(const Context& context);
  // After tracking: the pose of the frame just processed; nothing when lost.
  void commit(const std::optional<Rigid3>& cam_from_world);
  // The map was corrected.
  void move_world(const Rigid3& new_world_from_old_world);
  // The frame just processed became a keyframe: its silhouette is given again once its own detections are in.
  void note_keyframe();

  // Silhouettes of keyframes that detections have shown since; each once.
  std::vector<LateMask> take_late_masks();
  // A warning for the user, once: the detector failed in mid-run.
  std::optional<std::string> take_warning();
  bool wants_keyframe_points() const { return options_.filter == FilterKind::multiview; }

  std::string detector_kind() const;
  double detector_rate_hz() const;
  int detector_latency() const;
  const DetectionSchedule& schedule() const { return schedule_; }
  const StageTimes& times() const { return times_; }  // stages flow and filter
  StageTimes detector_times() const;
  void stop();

 private:
  struct PastFrame {
    FrameIndex frame = 0;
    std::shared_ptr<const RgbdImage> image;
    std::shared_ptr<const ImagePyramid> pyramid;
    std::vector<Eigen::Vector2f> corners;  // image pixels
    Image<float> score;                    // of the motion segmentation; keyframes only, and empty without it
    bool keyframe = false;
  };
  std::vector<PointMotion> follow(const PastFrame& from, const ImagePyramid& to,
                                  const std::vector<Detection>& boxes) const;
  void mark_keyframes(const PastFrame& source, const Detections& detections);
  void move_boxes_here(const ImagePyramid& pyramid);
  void receive(const Context& context, const std::shared_ptr<const ImagePyramid>& pyramid);
  MoverMask ask_prompt_detectors(const RgbdImage& image, std::vector<Detection>& boxes) const;
  MoverMask segment_motion(const Context& context, std::vector<Detection>& boxes);
  void filter(const Context& context, const std::vector<FilterFeature>& features, const MoverMask& given,
              const MoverMask& moving, DynamicScene& scene) const;
  void remember(const Context& context, std::shared_ptr<const ImagePyramid> pyramid);
  std::vector<FilterFeature> describe(const Context& context, const ImagePyramid& pyramid, bool with_flow) const;
  Rigid3 own_motion(const std::vector<FilterFeature>& features, const std::vector<Detection>& boxes,
                    const Rigid3& expected) const;

  CameraModel camera_;
  DynamicsOptions options_;
  OpticalFlow flow_;
  DetectionSchedule schedule_;
  std::unique_ptr<DetectionThread> slow_;
  std::vector<std::unique_ptr<Detector>> prompt_;
  std::optional<MotionSegmenter> motion_;
  bool segments_motion_ = false;  // as a detector of its own
  std::deque<PastFrame> past_;    // newest last; as many as the detector's latency needs
  struct Carried {
    Detection detection;
    int missed = 0;
  };
  std::vector<DueDetections> due_;  // results to be worked in at this frame
  std::vector<Carried> carried_;    // boxes of the slow detector in the newest image
  std::vector<LateMask> late_;
  StageTimes times_;
};

}  // namespace dkb
