// SPDX-License-Identifier: Apache-2.0
#include "simulate_command.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <system_error>

#include "dkb/simulator/sequence_writer.h"
#include "dkb/simulator/simulator.h"
#include "dkb/util/new_folder.h"
#include "dkb/util/plural.h"
#include "interrupt.h"
#include "number_check.h"

namespace dkb {
namespace {

struct SimulateArguments {
  SimulatorOptions options;
  std::string out;
  std::vector<double> blackout;
  std::vector<int> size;
};

// The images of a sequence that `simulate` wrote, by its list of pairs: of each frame colour, depth and mask, named as
// they are here and all there. Those of another recording are none of its business.
std::set<std::filesystem::path> images_in(const std::filesystem::path& folder) {
  std::set<std::filesystem::path> images;
  std::ifstream list(folder / "associations.txt");
  for (std::string line; std::getline(list, line);) {
    std::istringstream columns(line);
    std::string stamp, colour, depth_stamp, depth;
    if (!(columns >> stamp >> colour >> depth_stamp >> depth)) continue;
    if (colour != "rgb/" + stamp + ".jpg" || depth != "depth/" + depth_stamp + ".png") continue;
    const std::filesystem::path frame[] = {colour, depth, "masks/" + stamp + ".png"};
    std::error_code none;
    if (std::all_of(std::begin(frame), std::end(frame),
                    [&](const auto& image) { return std::filesystem::is_regular_file(folder / image, none); }))
      images.insert(std::begin(frame), std::end(frame));
  }
  return images;
}

void run_simulate(const SimulateArguments& arguments) {
  const Simulator simulator(arguments.options);
  for (const std::string& note : simulator.notes()) std::fprintf(stderr, "warning: %s\n", note.c_str());
  // Ends its line on a terminal also where an error is told after it.
  struct Line {
    const bool live = isatty(STDERR_FILENO) != 0;
    bool open = false;
    ~Line() {
      if (open) std::fputs("\n", stderr);
    }
  };
  const Interrupt interrupt([] {});
  NewFolder folder(arguments.out);
  const std::set<std::filesystem::path> earlier = images_in(arguments.out);
  {
    Line line;
    write_sequence(simulator, arguments.out, [&](int written) {
      Interrupt::check();
      if (!line.live) return;
      std::fprintf(stderr, "\rframe %d of %d", written, simulator.frames());
      line.open = true;
    });
  }
  folder.keep();
  // Of a longer sequence some would stay that no list names.
  const std::set<std::filesystem::path> written = images_in(arguments.out);
  std::error_code ignored;
  for (const std::filesystem::path& image : earlier)
    if (!written.contains(image)) std::filesystem::remove(folder.path() / image, ignored);
  std::printf(
      "%s: %s of scene %s, seed %llu\n", arguments.out.c_str(), plural(simulator.frames(), "frame", "frames").c_str(),
      arguments.options.path.empty() ? arguments.options.scene.c_str() : ("around " + arguments.options.path).c_str(),
      static_cast<unsigned long long>(arguments.options.seed));
}

}  // namespace

void register_simulate(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand("simulate", "Make a synthetic sequence in TUM layout, with its exact truth");
  std::string scenes;
  for (const std::string& name : simulator_scenes()) scenes += (scenes.empty() ? "" : ", ") + name;
  SimulatorOptions& o = arguments->options;
  command->add_option("--out", arguments->out, "folder to write; files of the same names are replaced")->required();
  command->add_option("--scene", o.scene, scenes + ", or a YAML scene file")->capture_default_str();
  command->add_option("--path", o.path,
                      "trajectory (TUM format) that the camera follows, the room furnished around it");
  command
      ->add_option(
          "--frames", o.frames,
          "frames at --rate; 0: as many as the scene needs (at 30 Hz 300; loop, twins, corridor 900; building 6000)")
      ->transform(whole_number<int>())
      ->capture_default_str();
  command->add_option("--rate", o.rate, "frames a second, 1 ... 60; the motion is the same in seconds")
      ->capture_default_str();
  command->add_option("--size", arguments->size, "WIDTHxHEIGHT of the images, 64x64 ... 4096x4096 (default: 640x480)")
      ->delimiter('x')
      ->transform(whole_number<int>())
      ->expected(2);
  command->add_option("--dropouts", o.dropouts,
                      "share of the frames that is missing, 0 ... 0.9, singly and in bursts; never the first");
  command->add_flag("--flicker", o.flicker, "exposure jumps, and lamps flicker at 100 Hz");
  command->add_option("--stand-still", o.stand_still,
                      "seconds that people stand from the start, half of them in view, before they walk off");
  command->add_option("--people", o.people, "people walking about, 0 ... 30 (default: the scene's own)")
      ->transform(whole_number(0, 30));
  command->add_option("--seed", o.seed, "of furniture, people, tremor and noise")
      ->transform(whole_number<uint64_t>())
      ->capture_default_str();
  command->add_option("--blackout", arguments->blackout, "START,SECONDS: colour and depth are black from there on")
      ->delimiter(',')
      ->expected(2);
  command->add_option("--odometry", o.odometry_drift,
                      "write odometry.txt: a share of error in length, and as many rad/m in heading");
  command->callback([arguments, &exit_code] {
    if (arguments->blackout.size() == 2) {
      arguments->options.blackout_start = arguments->blackout[0];
      arguments->options.blackout_seconds = arguments->blackout[1];
    }
    if (arguments->size.size() == 2) {
      arguments->options.width = arguments->size[0];
      arguments->options.height = arguments->size[1];
    }
    run_simulate(*arguments);
    exit_code = 0;
  });
}

}  // namespace dkb
