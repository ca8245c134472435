// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/geometry/alignment.h"

namespace dkb {

// Errors of a trajectory against the truth, defined as the tool evo defines them (docs of evo_ape and evo_rpe). The
// one difference is max_difference, which is 0.01 s there.

enum class DeltaUnit { frames, metres, seconds };

// Distance between the two poses of a relative error.
struct RpeDelta {
  double value = 1;  // > 0; whole for frames
  DeltaUnit unit = DeltaUnit::frames;
  void check() const;  // throws InvalidOption
};
RpeDelta parse_rpe_delta(const std::string& text);  // "1f", "0.5m", "2s"; throws InputError
std::string to_string(const RpeDelta& delta);

// What brings the estimate into the world of the truth: the rigid motion (se3) or the similarity (sim3) that fits the
// positions best, the motion that puts its first matched pose on the true one, or nothing. evo's -a, -as,
// --align_origin, and no option.
enum class Alignment { se3, sim3, origin, none };
Alignment alignment_named(const std::string& name, const std::string& where);  // throws InputError
const char* name_of(Alignment alignment);

struct EvaluationOptions {
  double max_difference = 0.02;  // [s] between matched stamps, >= 0
  double time_offset = 0;        // [s] added to the stamps of the estimate
  RpeDelta rpe_delta;
  bool rpe_all_pairs = false;  // from every pose on, in the place of stretches that do not overlap
  Alignment alignment = Alignment::se3;
  void check() const;  // throws InvalidOption
};

// Middle value, mean of the two middle ones when their number is even; NaN for none. Values must not be NaN.
double median_of(std::vector<double> values);

struct ErrorStatistics {
  double rmse = 0, mean = 0, median = 0, std = 0, min = 0, max = 0;
  size_t count = 0;
};
// `std` is that of the population. All zero when `errors` is empty.
ErrorStatistics error_statistics(const std::vector<double>& errors);

struct PoseErrors {
  std::vector<double> translation_m;
  std::vector<double> rotation_deg;  // angle of the relative rotation, 0 ... 180; none where it is not determined
  ErrorStatistics translation, rotation;
};

struct Evaluation {
  EvaluationOptions options;
  size_t truth_poses = 0, estimated_poses = 0;  // in the files
  std::vector<double> timestamps;               // [s] of the matched estimates
  std::vector<Rigid3> truth, estimate;          // matched, world_from_cam, the estimate aligned to the truth
  Similarity3 truth_from_estimate;              // the alignment
  // [deg] standard error of the alignment's rotation about the axis that positions tell least of; infinite where either
  // path lies on a line or in one place; 0 where positions have no say in it (origin, none).
  double rotation_sd_deg = 0;
  bool rotation_determined() const { return std::isfinite(rotation_sd_deg); }
  // By how much the estimate is to be enlarged to fit the truth best, where that is told from 1 beyond doubt: most
  // often a wrong depth factor. Nothing with sim3.
  std::optional<double> wrong_scale;
  PoseErrors ape;                                    // per matched pose
  PoseErrors rpe;                                    // per pair of poses
  std::vector<std::pair<size_t, size_t>> rpe_pairs;  // indices of matched poses
};

// Matches (index of a, index of b) as evo does: walks the shorter trajectory (b when equally long) and takes the
// nearest stamp of the longer one (the first of equals), if it is near enough; one pose of the longer may be taken more
// than once.
std::vector<std::pair<size_t, size_t>> match_stamps(const Trajectory& a, const Trajectory& b, double max_difference);

// APE after the alignment, and RPE over consecutive, not overlapping stretches of
// `rpe_delta`:
//   frames   poses 0, n, 2n, ...
//   metres   cut where the path of the estimate since the last cut reaches delta; the first cut is the first such place
//   seconds  cut at the first pose and wherever delta has passed since the last cut
// With `rpe_all_pairs` over the stretches from every pose to the later one that is nearest to delta away, if within a
// tenth of it: as evo takes all pairs, and nearly as the TUM benchmark's evaluate_rpe does.
// Deterministic. Throws InputError when fewer than 2 poses match; `name`, the estimate's, opens its message.
Evaluation evaluate(const Trajectory& truth, const Trajectory& estimate, const EvaluationOptions& options = {},
                    const std::string& name = {});

// A trajectory file to be evaluated: read_trajectory(), and InputError when it holds no pose.
Trajectory read_poses(const std::filesystem::path& path, size_t* hidden = nullptr);

}  // namespace dkb
