// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/loop_options.h"

#include "dkb/util/errors.h"

namespace dkb {

void LoopOptions::check() const {
  require_option(candidates >= 1, "loop.candidates", candidates, "at least 1");
  require_option(min_relative_similarity >= 0, "loop.min_relative_similarity", min_relative_similarity, "at least 0");
  require_option(neighbourhood >= 1, "loop.neighbourhood", neighbourhood, "at least 1");
  require_option(min_keyframes_between >= 0, "loop.min_keyframes_between", min_keyframes_between, "at least 0");
  require_option(area_keyframes >= 1, "loop.area_keyframes", area_keyframes, "at least 1");
  require_option(rest_keyframes >= 0, "loop.rest_keyframes", rest_keyframes, "at least 0");
  require_option(match_distance >= 0 && match_distance <= 256, "loop.match_distance", match_distance, "0 ... 256 bits");
  require_option(match_ratio >= 0 && match_ratio <= 1, "loop.match_ratio", match_ratio, "0 ... 1");
  require_option(min_ransac_inliers >= 6, "loop.min_ransac_inliers", min_ransac_inliers, "at least 6");
  require_option(radius_first > 0, "loop.radius_first", radius_first, "greater than 0 px");
  require_option(radius > 0, "loop.radius", radius, "greater than 0 px");
  require_option(min_inliers >= 10, "loop.min_inliers", min_inliers, "at least 10");
  require_option(min_share >= 0 && min_share <= 1, "loop.min_share", min_share, "0 ... 1");
  require_option(min_support >= 0, "loop.min_support", min_support, "at least 0");
  require_option(support_keyframes >= 0, "loop.support_keyframes", support_keyframes, "at least 0");
  require_option(support_inliers >= 10, "loop.support_inliers", support_inliers, "at least 10");
  require_option(support_translation > 0, "loop.support_translation", support_translation, "greater than 0 m");
  require_option(support_rotation > 0, "loop.support_rotation", support_rotation, "greater than 0 degrees");
  require_option(drift_translation_base >= 0, "loop.drift_translation_base", drift_translation_base, "at least 0 m");
  require_option(drift_translation_share >= 0, "loop.drift_translation_share", drift_translation_share, "at least 0");
  require_option(drift_rotation_base >= 0, "loop.drift_rotation_base", drift_rotation_base, "at least 0 degrees");
  require_option(drift_rotation_per_metre >= 0, "loop.drift_rotation_per_metre", drift_rotation_per_metre,
                 "at least 0");
  require_option(merge_min_inliers >= 10, "loop.merge_min_inliers", merge_min_inliers, "at least 10");
  require_option(merge_min_share >= 0 && merge_min_share <= 1, "loop.merge_min_share", merge_min_share, "0 ... 1");
  require_option(essential_shared_points >= 1, "loop.essential_shared_points", essential_shared_points, "at least 1");
  require_option(edge_position_sd > 0, "loop.edge_position_sd", edge_position_sd, "greater than 0 m");
  require_option(edge_position_share >= 0, "loop.edge_position_share", edge_position_share, "at least 0");
  require_option(edge_rotation_sd > 0, "loop.edge_rotation_sd", edge_rotation_sd, "greater than 0 rad");
  require_option(edge_rotation_growth >= 0, "loop.edge_rotation_growth", edge_rotation_growth, "at least 0");
  require_option(edge_rotation_share >= 0, "loop.edge_rotation_share", edge_rotation_share, "at least 0");
  require_option(graph_iterations >= 1, "loop.graph_iterations", graph_iterations, "at least 1");
}

}  // namespace dkb
