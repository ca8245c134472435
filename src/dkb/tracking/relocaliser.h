// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "dkb/features/image_appearance.h"
#include "dkb/map/map.h"
#include "dkb/matching/place_fit.h"
#include "dkb/tracking/place_evidence.h"

namespace dkb {

constexpr int kMinRelocalisationInliers = 40;  // map points that the pose of a camera found again rests on

// A pose that a similar keyframe led to, with what speaks for and against it.
struct PoseProposal {
  PlaceFit fit;
  std::vector<Candidate> around;  // the map there, of which `fit` tells what was seen
  // Of those that find() gives:
  std::vector<PointLook> looks;  // of well-known map points that should be in view, and are not hidden or gone
  double log_odds = 0;           // of all that was seen there, against a place that only looks like it
  bool ambiguous = false;        // another place in the map explains the view nearly as well

  bool verified = false;  // enough of the map is found from there, and tells where the camera is
};

// Where in the map is this frame? Asks the place index, matches descriptors with each keyframe that looks like the
// frame, seeks a pose by RANSAC and searches the map nearby it. Without any idea of where the camera was.
// Deterministic for a seed. Features that may lie on movers take no part.
class Relocaliser {
 public:
  Relocaliser(const Optics& optics, uint64_t seed);

  // Points of `ignored`, increasing, are not matched.
  // `appearance` may be null: then only what features tell is known of how a place looks.
  // The verified pose of the best odds; nothing when there is none. What the frame shows goes into `evidence`, what
  // earlier ones showed counts.
  std::optional<PoseProposal> find(const Map& map, const MatchableFeatures& features, std::span<const PointId> ignored,
                                   PointAppearance* appearance, PlaceEvidence& evidence) const;
  // The pose that this one keyframe leads to, verified or not.
  std::optional<PoseProposal> propose_from(const Map& map, KeyframeId keyframe, const MatchableFeatures& features,
                                           std::span<const PointId> ignored) const;

  // The pose near an expected one, among what this keyframe and those around it see, verified or not: points are sought
  // within `radius` [px] of where they are expected.
  std::optional<PoseProposal> propose_at(const Map& map, KeyframeId keyframe, const Rigid3& expected_cam_from_world,
                                         double radius, const MatchableFeatures& features,
                                         std::span<const PointId> ignored) const;

  // How the map looks from a proposed pose.
  void look_around(const Map& map, PointAppearance* appearance, PoseProposal& proposal) const;

 private:
  // All poses that look-alike keyframes led to, the most alike keyframe first, verified or not.
  std::vector<PoseProposal> propose(const Map& map, const MatchableFeatures& features, std::span<const PointId> ignored,
                                    PointAppearance* appearance) const;
  std::optional<PoseProposal> fit_around(const Map& map, const std::vector<PointId>& points,
                                         const MatchableFeatures& features, std::span<const PointId> ignored,
                                         const Rigid3& expected_cam_from_world, std::span<const float> radii) const;

  Optics optics_;
  uint64_t seed_;
};

}  // namespace dkb
