// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/keyframes/match_quality.h"
#include "dkb/keyframes/match_spread.h"
#include "dkb/keyframes/parallax_gate.h"
#include "dkb/keyframes/visibility.h"

namespace dkb {

// paper_keyframe_options() has the paper's numbers; docs/benchmarks.md compares both with the baseline rule.
struct AdaptiveKeyframeOptions {
  TranslationUnit translation_unit = TranslationUnit::depth_percent;  // of the gate                 (DKB eq. 25)
  Similarity similarity = Similarity::pks;  // in the visibility vote                              (DKB eq. 34)
  NormalSum normals = NormalSum::oriented;  // of the map points' surfaces                         (DKB eq. 28)
  int visibility_levels = 9;                // of 10 degrees each, 2 ... 18                        (DKB eq. 32)
  int min_frames_between = 2;               // [frames] from a keyframe to the next, whoever asks for it, >= 1
  // The safety floor: keyframes are made, whatever the votes, while tracking is in danger: with few points, few close
  // ones while many could be made, or ...
  double floor_reference_ratio = 0.7;  // a smaller share of the reference keyframe's points, 0 ... 1
  double floor_kept_ratio = 0.5;       // or of the points tracked in the first frame after the last keyframe, 0 ... 1
};

// DKB section 3.2 as printed: T of 10 to 30, S of eq. 34, four levels, plain sums of cross products; the floor is the
// least that keeps tracking alive.
AdaptiveKeyframeOptions paper_keyframe_options();

// Keyframes by parallax, visibility, match quality and spread of the matches (DKB section 3.2, eqs. 14-41), with a
// floor that keeps tracking alive. A frame becomes a keyframe when the gate is open and both votes are for it.
//
// The votes compare with the last keyframe as the map view shows it: while mapping has not published that keyframe,
// only the floor decides. Frames must be offered one by one, since the gate averages over a window and the reference
// frame is the first one after a keyframe. Deterministic.
class AdaptiveKeyframePolicy final : public KeyframeDecider {
 public:
  // The size [px] is that of the images.
  AdaptiveKeyframePolicy(const AdaptiveKeyframeOptions& options, int image_width, int image_height);
  KeyframeDecision decide(const KeyframeContext& query, const Map& map) override;

 private:
  // The first frame after the last keyframe, as it was then.
  struct ReferenceFrame {
    KeyframeId keyframe = kNoKeyframe;
    std::vector<PointId> points;
    Rigid3 cam_from_keyframe;
    int tracked_points = 0;
  };
  // A point of the last keyframe, in that keyframe's camera: what follows does not change when the world moves.
  struct KeyframePoint {
    PointId id = kNoPoint;
    Eigen::Vector3d point_in_keyframe, normal_in_keyframe;
    int level = 0;  // in the keyframe; 0 = the point has no normal and does not vote
  };
  struct Matches {
    int matches = 0, changed = 0;
    std::vector<Eigen::Vector2f> pixels;
  };

  void study_keyframe(KeyframeId id, const Map& map);
  // Whether a point of the keyframe was fused into another one since it was studied.
  bool stale(const Map& map) const;
  const KeyframePoint* find(PointId id) const;
  bool level_changed(const KeyframePoint& point, const Eigen::Vector3d& camera_in_keyframe) const;
  Matches match(const KeyframeContext& query, const Rigid3& cam_from_keyframe) const;

  AdaptiveKeyframeOptions options_;
  int image_width_, image_height_;
  ParallaxGate gate_;
  ReferenceFrame reference_;
  KeyframeId studied_ = kNoKeyframe;            // the keyframe of what follows
  std::vector<KeyframePoint> keyframe_points_;  // by id
  int reference_matches_ = 0, reference_changed_ = 0;
};

}  // namespace dkb
