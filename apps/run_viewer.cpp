// SPDX-License-Identifier: Apache-2.0
#include "run_viewer.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/timing.h"
#include "interrupt.h"
#include "number_check.h"
#include "terminal.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

constexpr std::chrono::milliseconds kPatience{100};  // an interrupt is noticed after so long

// None where the file cannot be used, for a run does not depend on it.
std::vector<ViewerOptions::TruePosition> true_positions(const fs::path& source) try {
  std::vector<ViewerOptions::TruePosition> positions;
  for (const StampedPose& p : truth_beside(source).value_or(Trajectory()))
    positions.push_back({std::llround(p.timestamp * 1e9), p.world_from_cam.translation});
  return positions;
} catch (const InputError&) {
  return {};
}

}  // namespace

std::vector<std::string> with_default_port(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  for (size_t i = 0; i < words.size(); ++i) {
    if (words[i] != "--viewer") continue;
    const bool has_port = i + 1 < words.size() && !words[i + 1].empty() &&
                          words[i + 1].find_first_not_of("0123456789") == std::string::npos;
    if (!has_port) words[i] = fmt::format("--viewer={}", ViewerArguments().port);
  }
  return words;
}

void add_viewer_options(CLI::App& command, ViewerArguments& args) {
  command
      .add_option("--viewer", args.port, "Live page in the browser at this port (8090 by default, 0 = any free one)")
      ->transform(whole_number(0, 65535))
      ->each([&args](const std::string&) { args.on = true; });
  command.add_flag("--viewer-exit", args.exit, "End with the run instead of serving the page until Ctrl-C");
  command
      .add_option("--viewer-host", args.host,
                  "Address to serve at; another than 127.0.0.1 lets other machines in, with the printed token")
      ->each([&args](const std::string&) { args.has_host = true; });
}

RunViewer::RunViewer(const ViewerArguments& args, const Source& source, const std::string& source_name,
                     const Options& options, fs::path out)
    : serves_(args.on), exit_(args.exit), out_(std::move(out)) {
  ViewerOptions o;
  o.host = args.host;
  o.port = args.on ? std::optional(args.port) : std::nullopt;
  if (args.record) o.record = out_ / "session.dkbs";
  o.description = source.description();
  o.camera = source.camera();
  o.frames = source.size();
  if (o.camera.fps > 0) o.budget_ms = 1000 / o.camera.fps;
  o.realtime = options.realtime;
  o.truth = true_positions(source_name);
  viewer_ = open_viewer(o);
  if (!serves_) return;
  tell(stderr, "viewer: {}\n", viewer_->url());
  std::fflush(stderr);
}

void RunViewer::save_if_asked(const Slam& slam) {
  if (!viewer_->take_save_order()) return;
  try {
    slam.save_map(out_ / "map_saved.dkb");
    viewer_->say("map saved: " + (out_ / "map_saved.dkb").string());
  } catch (const InputError& e) {
    viewer_->say(e.what());
  }
}

void RunViewer::wait_turn(const Slam& slam, const std::function<void(bool)>& hold) {
  save_if_asked(slam);
  if (!viewer_->paused()) return;
  hold(true);
  const Stopwatch watch;
  while (!Interrupt::happened() && !viewer_->wait_turn(kPatience)) save_if_asked(slam);
  paused_s_ += watch.ms() / 1000;
  hold(false);
}

void RunViewer::show(FrameResult result, const Frame& frame, const Slam& slam, std::vector<Event> events) {
  viewer_->show(std::move(result), frame, slam.map(), std::move(events));
  if (slam.options().dense_map && viewer_->wants_dense_map()) viewer_->show_dense_map(slam.dense_map_task());
}

void RunViewer::serve_on(const Slam& slam, bool quiet) {
  if (slam.options().dense_map && !Interrupt::happened()) viewer_->show_dense_map(slam.dense_map_task());
  viewer_->ended(slam.map());
  if (!serves_ || exit_ || Interrupt::happened()) return;
  if (!quiet) tell(stdout, "the page is served until Ctrl-C\n");
  while (!Interrupt::happened()) {
    save_if_asked(slam);
    viewer_->wait_order(kPatience);
  }
}

}  // namespace dkb
