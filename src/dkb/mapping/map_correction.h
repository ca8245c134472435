// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/map/map.h"

namespace dkb {

// What loop closing, merging of maps or global bundle adjustment found on a snapshot, for the map as it is by then.
struct MapCorrection {
  struct Pose {
    KeyframeId keyframe = kNoKeyframe;
    Rigid3 before, after;  // cam_from_world in the snapshot and as it ought to have been
  };
  struct Position {
    PointId point = kNoPoint;
    Eigen::Vector3d before, after;  // [m] likewise
  };
  struct Outlier {
    PointId point = kNoPoint;
    KeyframeId keyframe = kNoKeyframe;
  };
  enum class Kind { loop, merge, adjustment };

  Kind kind = Kind::adjustment;
  std::vector<Pose> poses;                        // each keyframe once, in any order
  std::vector<Position> positions;                // by increasing point; other points follow a keyframe that sees them
  std::vector<Outlier> outliers;                  // to be forgotten
  std::vector<std::pair<PointId, PointId>> same;  // pairs of points that are one
  // Keyframes on either side of the seam, whose points are to be looked for on the other side and fused.
  std::vector<KeyframeId> near_side, far_side;
  // Of a merge: the map of `near_joint` becomes part of the other one, `near_joint` a child of `far_joint`.
  KeyframeId near_joint = kNoKeyframe, far_joint = kNoKeyframe;
  // Of a merge: of how the map that moves lies in the other one, in that one's axes, [translation m, rotation rad].
  Matrix6d joint_covariance = Matrix6d::Zero();
};

// Moves keyframes and points of `map`, and hangs one tree on another where two maps merge. What mapping did since the
// snapshot stays where a loop is closed or two maps merge: a keyframe's correction is applied on top of its present
// pose. An adjustment takes its place: local adjustment relieved the same tension meanwhile, which on top of it would
// count twice. What an adjustment leaves where it was stays as mapping has it by now, and is not copied. Keyframes made
// meanwhile follow their parents in the spanning tree; points without a correction of their own follow the keyframe
// that they were born at, or else the oldest that sees them. Ids that are gone by now are passed over. Deterministic.
void move_map(Map& map, const MapCorrection& correction);

}  // namespace dkb
