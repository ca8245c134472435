// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

struct LoopOptions {
  bool enabled = true;

  // Candidates.
  int candidates = 4;                    // most alike keyframes outside the neighbourhood that are verified, >= 1
  double min_relative_similarity = 0.4;  // of a candidate, as a share of the most alike neighbour's score, >= 0
  int neighbourhood = 2;                 // steps along covisibility that make a keyframe a neighbour, >= 1
  int min_keyframes_between = 10;        // [keyframes] younger ones are never candidates, >= 0
  int area_keyframes = 8;                // a candidate and its best covisible keyframes, whose points are matched, >= 1
  int rest_keyframes = 5;                // [keyframes] without a search after a loop was closed, >= 0

  // Verification.
  int match_distance = 60;      // [bits] of a descriptor match, 0 ... 256
  double match_ratio = 0.85;    // best over second best distance, 0 ... 1
  int min_ransac_inliers = 15;  // pairs of points that one rigid motion explains, >= 6
  double radius_first = 12;     // [px] guided search under that motion, > 0
  double radius = 4;            // [px] the same under the refined pose, > 0
  int min_inliers = 50;         // map points that the refined pose rests on, >= 10
  double min_share = 0.2;       // of the well-known points of the area that ought to be in view, 0 ... 1

  // Consistency: keyframes around the newest one that show the area just there as well.
  int min_support = 2;                // of them, >= 0
  int support_keyframes = 8;          // asked at most, >= 0
  int support_inliers = 30;           // points of the area that such a keyframe must show, >= 10
  double support_translation = 0.08;  // [m] by which they may differ, > 0
  double support_rotation = 3;        // [deg] > 0

  // Plausibility: what can have drifted along the shortest path through the map from the one keyframe to the other.
  double drift_translation_base = 0.2;    // [m] >= 0
  double drift_translation_share = 0.08;  // of the path's length, >= 0
  double drift_rotation_base = 8;         // [deg] >= 0
  double drift_rotation_per_metre = 1.5;  // [deg/m] >= 0

  // Between maps that are not joined there is no way, and appearance alone decides.
  int merge_min_inliers = 80;    // >= 10
  double merge_min_share = 0.3;  // 0 ... 1

  // Pose graph.
  int essential_shared_points = 100;    // [points] shared by two keyframes whose relative pose is an edge, >= 1
  double edge_position_sd = 0.005;      // [m] of an edge without length, > 0
  double edge_position_share = 0.01;    // growth of that with the edge's length, >= 0
  double edge_rotation_sd = 0.002;      // [rad] > 0
  double edge_rotation_growth = 0.004;  // [rad/m] >= 0
  double edge_rotation_share =
      0.02;                   // growth of that with the edge's rotation: images of a rotating camera are sheared, >= 0
  int graph_iterations = 20;  // steps of the optimisation, >= 1

  void check() const;
};

}  // namespace dkb
