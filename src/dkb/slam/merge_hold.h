// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "dkb/mapping/map_correction.h"
#include "dkb/tracking/frame.h"
#include "dkb/tracking/relocaliser.h"

namespace dkb {

// A map point of which some views said whether it looks as the map has it.
struct JudgedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m]
  int votes = 0;                                       // views in which it did, less those in which it did not
};

// What tells a place from another one that looks like it: things that are others. Corners fail one by one, but of a
// thing that is another one all look different.
struct PlaceDifference {
  int judged = 0;     // points with others around
  int different = 0;  // of these, the ones that look different and so do most of the three nearest
};
PlaceDifference difference_of(std::vector<JudgedPoint> points);

// A merge that waits for what the frames after it show. Two maps meet by appearance alone, and a room that looks like
// another one passes for it: so the map that the camera is not in is looked at from where the merge would put it.
// Without a merge that waits nothing is done. Deterministic.
class MergeHold {
 public:
  MergeHold(const Optics& optics, uint64_t seed) : relocaliser_(optics, seed) {}

  // Takes the place of one that waits. What was seen for or against the same two maps counts on.
  void hold(std::shared_ptr<const MapCorrection> merge, const Map& map);
  bool waits() const { return merge_ != nullptr; }
  // The map moved in another way than the merge knows of.
  void drop() { merge_.reset(); }
  // A frame that was tracked in the map of `root`. Returns the merge when it is to be made.
  std::shared_ptr<const MapCorrection> look(const Map& map, KeyframeId root, const TrackedFrame& frame,
                                            PointAppearance* appearance);

 private:
  Relocaliser relocaliser_;
  std::shared_ptr<const MapCorrection> merge_;
  KeyframeId here_ = kNoKeyframe, there_ = kNoKeyframe;  // roots: of the camera's map, and of the one that is looked at
  std::map<PointId, JudgedPoint> seen_;                  // of `there_`
  bool refused_ = false;                                 // they are two places
  KeyframeId near_ = kNoKeyframe;                        // a keyframe of `there_` that sees what the camera does
  Rigid3 here_from_there_;
};

}  // namespace dkb
