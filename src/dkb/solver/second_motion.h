// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/solver/pose_optimiser.h"

namespace dkb {

// How much of a surface a match stands for, in any unit: as much as the image shows around it, which grows with the
// square of its depth. Of two motions or poses that part of the matches agree with each, the camera's is the one with
// the most surface: the room has more of it than whoever hides it.
inline double surface_around(double depth) {
  return depth * depth;
}

struct SecondMotion {
  std::vector<uint8_t> moves;  // per observation: 1 = it moves by the motion that is not the camera's
  Rigid3 cam_from_world;       // by the camera's
  // Two motions explain the matches better by more than what six parameters save of any n matches: their cost, which is
  // minus twice a log likelihood, is less by 6 ln n (Schwarz, Annals of Statistics 1978). One frame may leave matches
  // out for less; later ones may be told that he moves only then.
  bool sure = false;
  double expected_weight = 0;  // of what is expected of the camera, beside what shows its motion: Student's t again
};

// Whether two motions explain what one pose explains badly: somebody whose points the map holds as still walks off, and
// a pose between his motion and the camera's keeps most matches within their limits. One match more or less that does
// not fit says little then, but a body is many that fit each other.
//
// Each match is of one of two motions (expectation maximisation), with Student's t of pose_optimiser for its errors and
// a cost for each of its nearest neighbours that is of the other one (Potts). It starts from what is near against what
// is far, since only what is near can turn and shift a camera that sees more of the room than of him, and from what
// fits an `other` pose better (null: there is none). Two motions are believed where they take enough off the cost of
// one: so much that it makes up for how much less the camera's is `expected` than the one motion was, by what the
// camera did before (null: nothing is known of that). Blur and a shutter in a fast turn look like two motions, but no
// hand shifts a camera by a decimetre between two frames. The camera's is the one with the most surface. All is linear
// about the pose.
//
// Nothing where one motion will do, or where fewer than `min_still` observations would be of the camera's, or an eighth
// of either, or where of the camera's neither half nor `min_still` have a depth of their own. Deterministic.
std::optional<SecondMotion> second_motion(const CameraModel& camera, const Rigid3& cam_from_world,
                                          std::span<const PoseObservation> observations, int min_still,
                                          const PosePrior* expected = nullptr, const Rigid3* other = nullptr);

// Whether that is worth asking: what is near and what is far would each have a motion of its own that saves as much as
// a body must (score test: Rao, 1948).
bool near_and_far_differ(const CameraModel& camera, const Rigid3& cam_from_world,
                         std::span<const PoseObservation> observations);

}  // namespace dkb
