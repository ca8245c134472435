// SPDX-License-Identifier: Apache-2.0
// Does tracking slow down while loops are searched, corrected and adjusted beside it? As a Markdown table.
//
//   correction_bench [--runs N] FOLDER ...
//
// Each FOLDER is in TUM layout and holds a loop. It is tracked N times (3) with loop closing and N times without, in
// turn. "Corrected" are the frames from when the search that found a loop was given its view until ten frames after the
// map that was adjusted as a whole became visible; "others" are the rest of the same run. The last columns compare the
// corrected frames with the same ones of the run without loop closing. Medians of the runs.
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/slam/frame_rate.h"
#include "dkb/slam/options.h"
#include "dkb_slam/source.h"
#include "frame_times.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

constexpr int kFramesAfter = 10;
constexpr int kWarmUp = 30;  // frames in which caches and the map fill

struct Tracked {
  std::vector<FrameTime> times;  // by frame
  std::vector<bool> corrected;   // likewise
  int loops = 0;
};

Tracked track(const fs::path& folder, bool loops) {
  const auto source = open_folder(folder);
  Options options;
  if (!loops) options.disable("loop");
  const SlamOptions inner = expand(options);
  const FrameRate rate(source->camera().fps);
  Slam slam(source->camera(), options, Detectors::none());
  Tracked out;
  struct Window {
    FrameIndex first, last;
  };
  std::vector<Window> windows;
  for (SourceFrame next = source->next(); next.state != SourceState::ended; next = source->next()) {
    if (next.state != SourceState::frame) continue;
    FrameResult result;
    out.times.push_back(timed_frame(slam, next.frame, &result));
    const Statistics s = slam.statistics();
    if (s.loops + s.merges == out.loops) continue;
    out.loops = s.loops + s.merges;
    const LoopStageOptions& stage = inner.loop_closing;
    const FrameIndex mapping = rate.frames(inner.pipeline.mapper_latency);
    windows.push_back({result.frame - rate.frames(stage.loop_latency(s.keyframes)),
                       result.frame + 2 * mapping + rate.frames(stage.global_ba_latency(s.keyframes)) + kFramesAfter});
  }
  slam.finish();
  out.corrected.assign(out.times.size(), false);
  for (const Window& w : windows)
    for (FrameIndex f = std::max<FrameIndex>(w.first, 0); f <= w.last; ++f)
      if (f < static_cast<FrameIndex>(out.times.size())) out.corrected[static_cast<size_t>(f)] = true;
  return out;
}

// The frames of `run` that are (not) corrected by `marks`.
std::vector<FrameTime> chosen(const Tracked& run, const std::vector<bool>& marks, bool corrected) {
  std::vector<FrameTime> times;
  for (size_t f = kWarmUp; f < run.times.size(); ++f)
    if (marks[f] == corrected) times.push_back(run.times[f]);
  return times;
}

void measure(const fs::path& folder, int runs) {
  std::vector<double> clock, clock_others, cpu, cpu_others, clock_without, cpu_without;
  int loops = 0;
  size_t frames = 0;
  for (int r = 0; r < runs; ++r) {
    const Tracked with = track(folder, true), without = track(folder, false);
    loops = with.loops;
    const auto marked = chosen(with, with.corrected, true), others = chosen(with, with.corrected, false),
               same = chosen(without, with.corrected, true);
    frames = marked.size();
    clock.push_back(p95(marked, &FrameTime::tracking_ms));
    clock_others.push_back(p95(others, &FrameTime::tracking_ms));
    clock_without.push_back(p95(same, &FrameTime::tracking_ms));
    cpu.push_back(p95(marked, &FrameTime::cpu_ms));
    cpu_others.push_back(p95(others, &FrameTime::cpu_ms));
    cpu_without.push_back(p95(same, &FrameTime::cpu_ms));
  }
  const auto ratio = [](const std::vector<double>& a, const std::vector<double>& b) {
    std::vector<double> ratios;
    for (size_t i = 0; i < a.size(); ++i) ratios.push_back(a[i] / b[i]);
    return percentile(ratios, 0.5);
  };
  fmt::print("| {} | {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n",
             folder.filename().string(), loops, frames, percentile(clock_others, 0.5), percentile(clock, 0.5),
             ratio(clock, clock_others), percentile(cpu_others, 0.5), percentile(cpu, 0.5), ratio(cpu, cpu_others),
             ratio(clock, clock_without), ratio(cpu, cpu_without));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    int runs = 3;
    std::vector<fs::path> folders;
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      if (word == "--runs" && i + 1 < argc)
        runs = std::max(1, std::atoi(argv[++i]));
      else if (!word.starts_with("--"))
        folders.emplace_back(word);
      else
        throw std::runtime_error("usage: correction_bench [--runs N] FOLDER ...");
    }
    if (folders.empty()) {
      fmt::print("correction_bench needs a sequence with a loop: dkb-slam simulate --scene loop --out FOLDER\n");
      return 0;
    }
    fmt::print(
        "| sequence | loops | corrected frames | p95 ms of others | of corrected | ratio | p95 CPU ms of others | of "
        "corrected | ratio | to no loop closing | CPU |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (const fs::path& f : folders) measure(f, runs);
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 2;
  }
  return 0;
}
