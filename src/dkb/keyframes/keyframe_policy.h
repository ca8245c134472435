// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/map/map.h"

namespace dkb {

// What a policy may know of a tracked frame.
struct KeyframeContext {
  FrameIndex frame = 0;
  int64_t stamp_ns = 0, last_keyframe_stamp_ns = 0;
  FrameIndex last_keyframe_frame = 0;  // frame of the newest keyframe
  FrameIndex last_relocalisation_frame = -1000000;
  KeyframeId last_keyframe = kNoKeyframe;
  bool mapper_idle = true;         // no keyframe or correction outstanding in logical time
  int tracked_points = 0;          // inliers of the final pose
  int tracked_close_points = 0;    // of these, with a depth below the close limit
  int creatable_close_points = 0;  // features with such a depth that show no map point
  int reference_points = 0;        // points of the reference keyframe that other keyframes see as well
  Rigid3 cam_from_world;
  Rigid3 last_keyframe_cam_from_world;
  // Inliers: what was matched and where.
  const std::vector<PointId>* points = nullptr;  // per feature; kNoPoint where nothing was matched
  const RgbdFeatures* features = nullptr;
  std::vector<std::optional<Eigen::Vector3d>> positions;  // [m] per feature: of its point; for a user's rule alone
  bool explain = false;                                   // fill KeyframeDecision::explanation
};

enum class KeyframeRule { none, first, baseline, adaptive, floor, own };
const char* name_of(KeyframeRule rule);
const char* yes_or_no(bool yes);  // for explanations

// [points] Fewer tracked close points, while at least so many could be made, call for a keyframe: as published with
// ORB-SLAM2 for RGB-D cameras.
constexpr int kFewClose = 100, kManyCreatable = 70;

// Which tests spoke for a keyframe. The baseline rule has no gate and no votes, and its few_points speaks against one.
struct KeyframeTests {
  bool waited = false;       // long enough since the last keyframe
  bool parallax = false;     // the gate                                           (DKB section 3.2)
  bool votes_asked = false;  // it was open, the pause was over, and the last keyframe was in the map
  bool visibility = false, spread = false;
  bool few_points = false, close_points = false, view_left = false;  // the safety floor
};

// How often each test spoke for a keyframe.
class KeyframeTestCounts {
 public:
  KeyframeTestCounts();
  void add(const KeyframeTests& tests);
  const std::map<std::string, int>& by_name() const { return by_name_; }  // and "decisions": how often they were made

 private:
  std::map<std::string, int> by_name_;
};

struct KeyframeDecision {
  bool insert = false;
  KeyframeRule rule = KeyframeRule::none;
  std::string explanation;  // every test with its numbers, for logs; empty unless asked for
  KeyframeTests tests = {};
};

// The rule, and of the floor the tests that spoke: "adaptive", "floor (few points, view left)".
std::string rule_of(const KeyframeDecision& decision);
// One line: the decision and its explanation.
std::string explained(const KeyframeDecision& decision);

// Decides whether a tracked frame becomes a keyframe.
// Deterministic: the same frames in the same order give the same decisions.
class KeyframeDecider {
 public:
  virtual ~KeyframeDecider() = default;
  virtual KeyframeDecision decide(const KeyframeContext& query, const Map& map) = 0;
};

// The rule published with ORB-SLAM2 (T-RO 2017) for RGB-D cameras, as restated in DKB section 3.2.
class BaselineKeyframePolicy final : public KeyframeDecider {
 public:
  KeyframeDecision decide(const KeyframeContext& query, const Map& map) override;
};

}  // namespace dkb
