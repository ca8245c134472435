// SPDX-License-Identifier: Apache-2.0
#include "eval/eval_command.h"

#include <cstdio>
#include <filesystem>
#include <memory>

#include "dkb/evaluation/evaluation_report.h"
#include "dkb/evaluation/trajectory_error.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "terminal.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

struct EvalArguments {
  std::string truth, estimate, rpe_delta = "1f", align, json, plot;
  bool scale = false;
  EvaluationOptions options;
};

Evaluation evaluate_files(const EvalArguments& arguments) {
  EvaluationOptions options = arguments.options;
  options.rpe_delta = parse_rpe_delta(arguments.rpe_delta);
  if (!arguments.align.empty()) options.alignment = alignment_named(arguments.align, "--align");
  if (arguments.scale && !arguments.align.empty() && options.alignment != Alignment::sim3)
    throw InputError("--scale: is --align sim3; leave one of them out");
  if (arguments.scale) options.alignment = Alignment::sim3;
  size_t hidden = 0;
  const Trajectory truth = read_poses(arguments.truth, &hidden);
  if (hidden > 0) tell(stderr, "warning: {}: {}\n", arguments.truth, hidden_text(hidden));
  return evaluate(truth, read_poses(arguments.estimate), options, arguments.estimate);
}

void run_eval(const EvalArguments& arguments) {
  if (!arguments.plot.empty() && fs::path(arguments.plot).extension() != ".svg")
    throw InputError(arguments.plot + ": plots are SVG pictures; give a name that ends in .svg");
  const Evaluation evaluation = evaluate_files(arguments);
  if (!arguments.json.empty()) write_file_atomically(arguments.json, evaluation_json(evaluation));
  if (!arguments.plot.empty()) {
    write_file_atomically(arguments.plot, evaluation_svg(evaluation, fs::path(arguments.estimate).filename().string()));
  }
  for (const std::string& warning : evaluation_warnings(evaluation)) tell(stderr, "warning: {}\n", warning);
  std::fputs(evaluation_table(evaluation).c_str(), stdout);
}

}  // namespace

void register_eval(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<EvalArguments>();
  CLI::App* command = app.add_subcommand(
      "eval", "Score a trajectory against the truth: APE and RPE as evo's, of stamps within 0.02 s (evo: 0.01 s)");
  command->add_option("GROUNDTRUTH", arguments->truth, "true trajectory (TUM format)")->required();
  command->add_option("ESTIMATE", arguments->estimate, "estimated trajectory (TUM format)")->required();
  command->add_option("--max-diff", arguments->options.max_difference, "[s] between matched stamps")
      ->capture_default_str();
  command
      ->add_option("--rpe-delta", arguments->rpe_delta,
                   "N{f|m|s}: stretch of the relative error in frames, metres or seconds")
      ->capture_default_str();
  command->add_flag("--rpe-all-pairs", arguments->options.rpe_all_pairs,
                    "such a stretch from every pose on, as papers quote them (default: stretches that do not overlap)");
  command->add_option("--time-offset", arguments->options.time_offset, "[s] added to the stamps of the estimate")
      ->capture_default_str();
  command->add_option("--align", arguments->align,
                      "by the rigid motion (se3, the default) or the similarity (sim3) that fits all positions, by the "
                      "first pose (origin), or none");
  command->add_flag("--scale", arguments->scale, "the same as --align sim3 (monocular estimates)");
  command->add_option("--json", arguments->json, "write the figures to this file");
  command->add_option("--plot", arguments->plot, "draw paths and errors into this file (.svg)");
  command->callback([arguments, &exit_code] {
    run_eval(*arguments);
    exit_code = 0;
  });
}

}  // namespace dkb
