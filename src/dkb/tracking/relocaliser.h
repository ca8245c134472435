// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "dkb/features/frame_features.h"
#include "dkb/features/image_appearance.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/map/map.h"
#include "dkb/tracking/local_map.h"

namespace dkb {

struct RelocalisationOptions {
  int candidates = 6;               // look-alike keyframes that are tried, >= 1
  int neighbours = 4;               // covisible keyframes whose points are matched along with each one's, >= 0
  int min_matches = 15;             // matches by descriptor alone that make a candidate worth a try, >= 6
  int min_ransac_inliers = 10;      // of these, that must agree on a pose, >= 6
  double radius = 10.0;             // [px] first search nearby that pose; the second is within `radius_fine`, > 0
  double radius_fine = 4.0;         // [px] > 0
  int min_inliers = 40;             // points that the final pose rests on, >= 6
  double min_share = 0.1;           // of the map's well-known points in view that must be found, 0 ... 1
  double min_similarity = 0.7;      // of those points that the image shows at all, that must look as they did, 0 ... 1
  double min_similarity_far = 0.9;  // the same for a place that the camera cannot have come to since its loss, 0 ... 1
  double max_distance = 1.0;        // [m] such a place is farther than this from where the camera was lost, >= 0
  double max_speed = 2.0;           // [m/s] and this for every second since, >= 0
  double max_position_sd = 0.01;    // [m] standard deviation of the camera's place, > 0
  double ambiguity = 0.5;           // poses elsewhere with this share of the most inliers rival the best, 0 ... 1 ...
  double clear_lead = 0.03;         // ... unless they look less alike by this share; rivals make all worthless, 0 ... 1
  void check() const;
};

// A pose that a similar keyframe led to, with what speaks for and against it.
struct PoseProposal {
  KeyframeId keyframe = kNoKeyframe;  // that led to it
  Rigid3 cam_from_world;
  std::vector<PointId> points;  // per feature: the map point that it shows, else kNoPoint
  int inliers = 0;
  int well_known = 0, found = 0;  // well-known map points that should be in view; of these, found
  int similar = 0, changed = 0;   // of these, that look the same in the image; that look different, or are seen through
  double position_sd = 0;         // [m]
  bool verified = false;          // it meets the options

  double similarity() const { return similar + changed > 0 ? static_cast<double>(similar) / (similar + changed) : 1; }
};

// Where in the map is this frame? Asks the place index, matches descriptors with each keyframe that looks like the
// frame, seeks a pose by RANSAC and searches the map nearby it. Without any idea of where the camera was.
// Deterministic for a seed. Features that may lie on movers take no part.
class Relocaliser {
 public:
  Relocaliser(const CameraModel& camera, const SensorNoise& noise, double scale_factor, int levels,
              const RelocalisationOptions& options, const LocalMapOptions& local_map, uint64_t seed);

  // True for points that must not be matched.
  using IgnoresPoint = std::function<bool(PointId)>;

  // `appearance` may be null: then only what features tell is verified.
  // The verified pose; nothing when there is none, or when poses at different places explain the frame nearly as well.
  std::optional<PoseProposal> find(const Map& map, const MatchableFeatures& features, const IgnoresPoint& ignores,
                                   PointAppearance* appearance) const;
  // All poses that look-alike keyframes led to, the most alike keyframe first, verified or not.
  std::vector<PoseProposal> propose(const Map& map, const MatchableFeatures& features, const IgnoresPoint& ignores,
                                    PointAppearance* appearance) const;
  // The pose that this one keyframe leads to, verified or not.
  std::optional<PoseProposal> propose_from(const Map& map, KeyframeId keyframe, const MatchableFeatures& features,
                                           const IgnoresPoint& ignores, PointAppearance* appearance) const;

 private:
  std::optional<Rigid3> coarse_pose(const Map& map, KeyframeId keyframe, const MatchableFeatures& features,
                                    const IgnoresPoint& ignores, std::vector<PointId>& points) const;
  bool search(const std::vector<Candidate>& nearby, double radius, const MatchableFeatures& features,
              PoseProposal& proposal) const;
  void verify(const Map& map, const std::vector<Candidate>& nearby, const MatchableFeatures& features,
              PointAppearance* appearance, PoseProposal& proposal) const;

  CameraModel camera_;
  SensorNoise noise_;
  double scale_factor_;
  int levels_;
  RelocalisationOptions options_;
  LocalMapOptions local_map_;
  uint64_t seed_;
};

}  // namespace dkb
