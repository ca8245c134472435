// SPDX-License-Identifier: Apache-2.0
// Do memory, map and the times of tracking and mapping stay within bounds over a long run? As a Markdown table.
//
//   soak_bench [--rounds N] [--there-and-back] [--detector KIND] [--set KEY=VALUE] [--csv FILE] FOLDER
//
// FOLDER is in TUM layout and ends where it begins: it is tracked N times (15) in one go, its stamps moved on.
// --there-and-back: every second round is walked backwards, so that the ends need not meet. FILE gets a row every 300
// frames. See scripts/soak.sh.
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/stored_pair.h"
#include "dkb/image/test_frame.h"
#include "dkb/util/files.h"
#include "frame_times.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

constexpr size_t kRowFrames = 300;

struct Arguments {
  int rounds = 15;
  bool there_and_back = false;
  DetectorChoice detector;
  Options options;
  fs::path folder, csv;
};

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double total = 0, resident = 0;
  statm >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1024.0 * 1024.0);
}

// Of that, what is in use; the allocator keeps the rest for later. Frames decoded ahead come and go in it.
double in_use_mb() {
  const auto info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / (1024.0 * 1024.0);
}

// The sequence again and again. Between two rounds as much time passes as between its first two frames.
PairStream rounds_of(std::vector<DatasetPair> once, const CameraModel& camera, const Arguments& arguments) {
  if (once.size() < 2) throw std::runtime_error("the sequence is too short");
  const double first = once.front().timestamp, last = once.back().timestamp;
  const double period = last - first + (once[1].timestamp - first);
  PairStream current;
  return [=, round = 0]() mutable -> std::optional<StoredPair> {
    if (current)
      if (auto pair = current()) return pair;
    if (round == arguments.rounds) return std::nullopt;
    std::vector<DatasetPair> pairs = once;
    const bool back = arguments.there_and_back && round % 2 == 1;
    if (back) std::reverse(pairs.begin(), pairs.end());
    for (DatasetPair& p : pairs) {
      const double at = round * period + (back ? last - p.timestamp : p.timestamp - first);
      p.depth_timestamp = first + at + (p.depth_timestamp - p.timestamp);
      p.timestamp = first + at;
    }
    ++round;
    current = pairs_in_files(std::move(pairs), camera);
    return current();
  };
}

// The frames since the last row.
struct Span {
  std::vector<FrameTime> times;
  int tracked = 0, inserted = 0;
  double mapping_ms = 0, loop_ms = 0, correction_ms = 0, adjustment_ms = 0;

  void add(const FrameTime& time, const FrameResult& result) {
    times.push_back(time);
    tracked += result.tracked();
    inserted += result.keyframe;
    for (const StageTime& t : result.stages) {
      if (t.stage == "mapping") mapping_ms += t.ms;
      if (t.stage == "loop") loop_ms += t.ms;
      if (t.stage == "map_correction") correction_ms += t.ms;
      if (t.stage == "global_ba") adjustment_ms = std::max<double>(adjustment_ms, t.ms);
    }
  }
  double share_tracked() const { return 100.0 * tracked / static_cast<double>(times.size()); }
  double per_keyframe(double ms) const { return inserted > 0 ? ms / inserted : 0; }
  double mean(double FrameTime::*which) const {
    double sum = 0;
    for (const FrameTime& t : times) sum += t.*which;
    return sum / static_cast<double>(times.size());
  }
};

void run(const Arguments& arguments) {
  const std::vector<DatasetPair> once = open_tum_dataset(arguments.folder).pairs;
  const CameraModel camera = choose_camera("", arguments.folder).camera;
  RgbdReader reader(rounds_of(once, camera, arguments), {});
  Slam slam(camera, arguments.options, make_detectors(arguments.detector, camera));
  std::string csv =
      "frames,round,keyframes,keyframes_inserted,points,loops,rss_mb,in_use_mb,tracking_mean_ms,tracking_p95_ms,"
      "cpu_mean_ms,cpu_p95_ms,mapping_ms,loop_ms,map_correction_ms,global_ba_ms\n";
  fmt::print(
      "| frames | tracked % | keyframes | inserted | points | loops | MB | in use | mean ms | p95 ms | mean CPU ms | "
      "p95 CPU ms | of the first | mapping ms | loop search ms | longest adjustment ms |\n");
  fmt::print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  Span row, round;
  double first_cpu_p95 = 0;
  const size_t total = once.size() * static_cast<size_t>(arguments.rounds);
  while (const auto frame = reader.next()) {
    if (!frame->image) throw std::runtime_error(frame->stamp + ": " + frame->skipped);
    FrameResult result;
    const FrameTime time = timed_frame(slam, frame_of(frame->image), &result);
    row.add(time, result);
    round.add(time, result);
    const size_t done = frame->index + 1;
    const bool round_ends = done % once.size() == 0;
    if (done % kRowFrames != 0 && !round_ends) continue;
    const Statistics s = slam.statistics();
    const double mb = resident_mb(), in_use = in_use_mb();
    csv +=
        fmt::format("{},{},{},{},{},{},{:.1f},{:.1f},{:.2f},{:.2f},{:.2f},{:.2f},{:.2f},{:.2f},{:.1f},{:.1f}\n", done,
                    (done - 1) / once.size() + 1, s.keyframes, s.keyframes_inserted, s.map_points, s.loops, mb, in_use,
                    row.mean(&FrameTime::tracking_ms), p95(row.times, &FrameTime::tracking_ms),
                    row.mean(&FrameTime::cpu_ms), p95(row.times, &FrameTime::cpu_ms), row.per_keyframe(row.mapping_ms),
                    row.per_keyframe(row.loop_ms), row.correction_ms, row.adjustment_ms);
    row = {};
    if (!round_ends && done != total) continue;
    const double cpu = p95(round.times, &FrameTime::cpu_ms);
    if (first_cpu_p95 == 0) first_cpu_p95 = cpu;
    fmt::print(
        "| {} | {:.1f} | {} | {} | {} | {} | {:.0f} | {:.0f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.1f} | "
        "{:.1f} | {:.0f} |\n",
        done, round.share_tracked(), s.keyframes, s.keyframes_inserted, s.map_points, s.loops, mb, in_use,
        round.mean(&FrameTime::tracking_ms), p95(round.times, &FrameTime::tracking_ms), round.mean(&FrameTime::cpu_ms),
        cpu, cpu / first_cpu_p95, round.per_keyframe(round.mapping_ms), round.per_keyframe(round.loop_ms),
        round.adjustment_ms);
    std::fflush(stdout);
    if (!arguments.csv.empty()) write_file_atomically(arguments.csv, csv);
    round = {};
  }
  slam.finish();
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  arguments.detector.kinds = "none";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--there-and-back") {
      arguments.there_and_back = true;
    } else if (word == "--rounds" && i + 1 < argc) {
      arguments.rounds = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--detector" && i + 1 < argc) {
      arguments.detector.kinds = argv[++i];
    } else if (word == "--set" && i + 1 < argc) {
      arguments.options.assign(argv[++i], "--set");
    } else if (word == "--csv" && i + 1 < argc) {
      arguments.csv = argv[++i];
    } else if (!word.starts_with("--") && arguments.folder.empty()) {
      arguments.folder = word;
    } else {
      throw std::runtime_error(
          "usage: soak_bench [--rounds N] [--there-and-back] [--detector KIND] [--set KEY=VALUE] [--csv FILE] FOLDER");
    }
  }
  return arguments;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Arguments arguments = parse(argc, argv);
    if (arguments.folder.empty())
      fmt::print("soak_bench needs a closed sequence: see scripts/soak.sh\n");
    else
      run(arguments);
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 2;
  }
  return 0;
}
