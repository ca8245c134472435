// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/evaluation_report.h"

#include <filesystem>

#include "bindings.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"

namespace dkb::python {
namespace {

struct NamedTrajectory {
  Trajectory poses;
  std::string name;  // of its file
};

// Of a file in TUM format, or of (stamps_ns, poses) as Slam.trajectory() gives them. Rows of a file of the truth may be
// hidden, as in `dkb-slam eval`.
NamedTrajectory trajectory_of(const py::object& object, const char* name, bool is_truth = false) {
  if (!py::isinstance<py::tuple>(object)) {
    const std::string path = path_of(object, name);
    const Unlocked released;
    size_t hidden = 0;
    return {read_poses(path, is_truth ? &hidden : nullptr), path};
  }
  if (py::len(object) != 2) throw InputError(std::string(name) + ": give a file, or the pair (stamps_ns, poses)");
  const auto stamps = py::array_t<int64_t, py::array::c_style>::ensure(object[py::int_(0)]);
  const auto poses = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object[py::int_(1)]);
  PyErr_Clear();
  if (!stamps || !poses || stamps.ndim() != 1 || poses.ndim() != 3 || poses.shape(0) != stamps.shape(0))
    throw InputError(std::string(name) + ": give stamps_ns as int64 [N] and poses as float64 [N, 4, 4]");
  NamedTrajectory trajectory;
  for (py::ssize_t i = 0; i < stamps.shape(0); ++i) {
    if (i > 0 && stamps.at(i) <= stamps.at(i - 1))
      throw InputError(std::string(name) + ": stamps_ns must rise, but element " + std::to_string(i) + " (" +
                       std::to_string(stamps.at(i)) + ") is not after the one before; sort the poses by stamp");
    trajectory.poses.push_back(
        {seconds_from_ns(stamps.at(i)), "", pose_of(py::object(poses[py::int_(i)]), name + (" " + std::to_string(i)))});
  }
  return trajectory;
}

Evaluation evaluated(const py::object& truth, const py::object& estimate, const EvaluationOptions& options) {
  const NamedTrajectory t = trajectory_of(truth, "truth", true), e = trajectory_of(estimate, "estimate");
  const Unlocked released;
  return evaluate(t.poses, e.poses, options, e.name);
}

}  // namespace

void bind_evaluation(py::module_& module) {
  module.def("_evaluate_json",
             [](const py::object& truth, const py::object& estimate, double max_diff, const std::string& rpe_delta,
                bool all_pairs, double time_offset, const std::string& align) {
               return evaluation_json(evaluated(truth, estimate,
                                                {.max_difference = max_diff,
                                                 .time_offset = time_offset,
                                                 .rpe_delta = parse_rpe_delta(rpe_delta),
                                                 .rpe_all_pairs = all_pairs,
                                                 .alignment = alignment_named(align, "align")}));
             });
  module.def("_plot_svg", [](const py::object& estimate, const py::object& truth, const std::string& title) {
    if (truth.is_none()) return trajectory_svg(trajectory_of(estimate, "trajectory").poses, title);
    return evaluation_svg(evaluated(truth, estimate, {}), title);
  });
  module.def("_save_svg", [](const py::object& path, const std::string& svg) {
    const std::filesystem::path file = path_of(path, "path");
    if (file.extension() != ".svg")
      throw InputError(file.string() + ": plots are SVG pictures; give a name that ends in .svg");
    write_file_atomically(file, svg);
  });
}

}  // namespace dkb::python
