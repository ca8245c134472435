// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/evaluation/trajectory_error.h"

namespace dkb {

// The evaluation as a table for people (a few lines, one of which begins with APE).
std::string evaluation_table(const Evaluation& evaluation);

// What the figures hide, a line each: a scale that is wrong, a relative error of few pairs.
std::vector<std::string> evaluation_warnings(const Evaluation& evaluation);
// The first of these.
std::string scale_text(double wrong_scale);

// The evaluation as JSON: matched, estimated, align, scale, ape.translation_m.{rmse, mean, median, std, min, max},
// ape.rotation_deg.{...}, rpe.translation_m.{...}, rpe.rotation_deg.{...}, rpe.delta, rpe.pairs, rpe.all_pairs. Numbers
// of an empty set are null. ape.rotation_determined is false, and ape.rotation_deg null, where positions do not
// determine the alignment's rotation; ape.rotation_sd_deg is its standard error, elsewhere. wrong_scale is there only
// where the estimate's scale is.
std::string evaluation_json(const Evaluation& evaluation);

// Both paths in their two widest projections, and the APE over time, as one SVG picture without outside references.
std::string evaluation_svg(const Evaluation& evaluation, const std::string& title = "Trajectory error");

// A path alone, in its two widest projections, likewise. Throws InputError when it has no pose.
std::string trajectory_svg(const Trajectory& trajectory, const std::string& title = "Trajectory");

}  // namespace dkb
