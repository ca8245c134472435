// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/geometry/alignment.h"

namespace dkb {

// Errors of a trajectory against the truth, defined as the tool evo defines them (docs of evo_ape and evo_rpe).

enum class DeltaUnit { frames, metres, seconds };

// Distance between the two poses of a relative error.
struct RpeDelta {
  double value = 1;  // > 0; whole for frames
  DeltaUnit unit = DeltaUnit::frames;
  void check() const;  // throws InvalidOption
};
RpeDelta parse_rpe_delta(const std::string& text);  // "1f", "0.5m", "2s"; throws InputError
std::string to_string(const RpeDelta& delta);

struct EvaluationOptions {
  double max_difference = 0.02;  // [s] between matched stamps, >= 0
  RpeDelta rpe_delta;
  bool with_scale = false;  // align by a similarity instead of a rigid motion
  void check() const;       // throws InvalidOption
};

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
  // False where either path lies on a line or in one place: any turn about that aligns as well, and a rotation error
  // (ape.rotation_deg, which is empty) would be one of the turn that happened to be taken.
  bool rotation_determined = true;
  PoseErrors ape;                                    // per matched pose
  PoseErrors rpe;                                    // per pair of poses
  std::vector<std::pair<size_t, size_t>> rpe_pairs;  // indices of matched poses
};

// Matches (index of a, index of b) as evo does: walks the shorter trajectory (b when equally long) and takes the
// nearest stamp of the longer one (the first of equals), if it is near enough; one pose of the longer may be taken more
// than once.
std::vector<std::pair<size_t, size_t>> match_stamps(const Trajectory& a, const Trajectory& b, double max_difference);

// APE after least-squares alignment of the positions, and RPE over consecutive, not overlapping stretches of
// `rpe_delta`:
//   frames   poses 0, n, 2n, ...
//   metres   cut where the path of the estimate since the last cut reaches delta; the first cut is the first such place
//   seconds  cut at the first pose and wherever delta has passed since the last cut
// Deterministic. Throws InputError when fewer than 2 poses match; `name`, the estimate's, opens its message.
Evaluation evaluate(const Trajectory& truth, const Trajectory& estimate, const EvaluationOptions& options = {},
                    const std::string& name = {});

// A trajectory file to be evaluated: read_trajectory(), and InputError when it holds no pose.
Trajectory read_poses(const std::filesystem::path& path);

}  // namespace dkb
