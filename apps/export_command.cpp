// SPDX-License-Identifier: Apache-2.0
#include "export_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "dkb/dataset/trajectory_formats.h"
#include "dkb/evaluation/trajectory_error.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/plural.h"
#include "dkb_slam/source.h"
#include "export/results_recording.h"
#include "interrupt.h"
#include "report/other_maps.h"
#include "source_options.h"
#include "terminal.h"

namespace dkb {
namespace {

// What lies in the worlds of other maps than that of trajectory.txt is left out.
std::string with_left_out(const std::string& out, size_t poses, const std::filesystem::path& results) {
  std::string line = out + ": " + plural(poses, "pose", "poses");
  if (!std::filesystem::is_directory(results)) return line;
  const std::string others = other_maps_text(poses_of_maps(results));
  return others.empty() ? line : line + "; left out: " + others;
}

struct ExportArguments {
  std::string results, format, out, images;
  SourceOptions source;
};

void run_export(const ExportArguments& arguments) {
  namespace fs = std::filesystem;
  const fs::path results = arguments.results, out = arguments.out;
  const bool recording = out.extension() == ".mcap" || out.extension() == ".bag";
  if (arguments.format.empty() != recording)
    throw InputError(arguments.out + ": " +
                     (recording ? "a recording has no --format; leave it out"
                                : "give --format tum, kitti or euroc, or a name that ends in .mcap or .bag"));
  if (!recording && !arguments.images.empty())
    throw InputError("--images: --format " + arguments.format + " holds no pictures; leave it out");
  if (const std::string option = source_option_given(arguments.source); arguments.images.empty() && !option.empty())
    throw InputError(option + ": is that of --images; add them, or leave it out");
  if (recording) {
    if (!fs::is_directory(results))
      throw InputError(arguments.results + ": is no folder; give the folder that `dkb-slam run --out` wrote");
    const auto pictures = arguments.images.empty() ? nullptr : open_source(arguments.images, arguments.source);
    const Interrupt interrupt([] {});  // else it would leave half a file
    const size_t poses = write_results_recording(results, pictures.get(), out);
    tell(stdout, "{}\n", with_left_out(arguments.out, poses, results));
    return;
  }
  const Trajectory trajectory = read_poses(fs::is_directory(results) ? results / "trajectory.txt" : results);
  write_file_atomically(out, trajectory_to_text(trajectory, trajectory_format_named(arguments.format, "--format")));
  tell(stdout, "{}\n", with_left_out(arguments.out, trajectory.size(), results));
}

}  // namespace

void register_export(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<ExportArguments>();
  arguments->source.prior = PriorKind::none;  // pictures are all that is read
  CLI::App* command = app.add_subcommand("export", "Write a run's results in the formats of other tools");
  command->add_option("results", arguments->results, "folder of a run, or a trajectory in TUM format")->required();
  command->add_option("--format", arguments->format, "of the trajectory: tum, kitti or euroc (csv)")
      ->check(CLI::IsMember({"tum", "kitti", "euroc"}));
  command->add_option("--out", arguments->out, "file; .mcap or .bag: poses, path, cloud and images as a recording")
      ->required();
  command->add_option("--images", arguments->images, "source of the run: its pictures with features go along");
  add_source_options(*command, arguments->source);
  command->callback([arguments, &exit_code] {
    run_export(*arguments);
    exit_code = 0;
  });
}

}  // namespace dkb
