// SPDX-License-Identifier: Apache-2.0
// Do memory, map and tracking time stay within bounds when a camera goes round and round? As a Markdown table.
//
//   soak_bench [--laps N] [--period SECONDS] [--csv FILE] FOLDER
//
// FOLDER is in TUM layout and ends where it begins: it is tracked N times (15) in one go, its stamps moved on by the
// period (120 s) each time. FILE gets a row every ten seconds of the sequence. See scripts/soak.sh.
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/image/test_frame.h"
#include "dkb/util/files.h"
#include "frame_times.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

constexpr double kRowSeconds = 10;

struct Arguments {
  int laps = 15;
  double period = 120;  // [s]
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

std::vector<DatasetPair> laps_of(const std::vector<DatasetPair>& once, const Arguments& arguments) {
  std::vector<DatasetPair> pairs;
  for (int lap = 0; lap < arguments.laps; ++lap)
    for (DatasetPair p : once) {
      p.timestamp += lap * arguments.period;
      p.depth_timestamp += lap * arguments.period;
      if (!pairs.empty() && p.timestamp <= pairs.back().timestamp)
        throw std::runtime_error("a round of the sequence lasts longer than --period");
      pairs.push_back(std::move(p));
    }
  return pairs;
}

// The frames since the last row.
struct Span {
  std::vector<FrameTime> times;
  int tracked = 0;
  void add(const FrameTime& time, const FrameResult& result) {
    times.push_back(time);
    tracked += result.tracked();
  }
};

void run(const Arguments& arguments) {
  const std::vector<DatasetPair> once = open_tum_dataset(arguments.folder).pairs;
  const CameraModel camera = choose_camera("", arguments.folder).camera;
  const std::vector<DatasetPair> pairs = laps_of(once, arguments);
  RgbdReader reader(pairs, camera, {});
  Slam slam(camera, Options(), Detectors::none());
  const double start = once.front().timestamp;
  std::string csv = "seconds,keyframes,keyframes_inserted,points,loops,rss_mb,in_use_mb,tracking_p95_ms,cpu_p95_ms\n";
  fmt::print(
      "| round | tracked % | keyframes | inserted | points | loops | MB | in use | p95 ms | p95 CPU ms | of the first "
      "|\n");
  fmt::print("|---|---|---|---|---|---|---|---|---|---|---|\n");
  Span row, lap;
  double first_cpu_p95 = 0;
  for (int rows = 1, laps = 1; const auto frame = reader.next();) {
    if (!frame->image) throw std::runtime_error(frame->stamp + ": " + frame->skipped);
    FrameResult result;
    const FrameTime time = timed_frame(slam, frame_of(frame->image), &result);
    row.add(time, result);
    lap.add(time, result);
    const bool last = frame->index + 1 == pairs.size();
    const double next = (last ? frame->timestamp : pairs[frame->index + 1].timestamp) - start;
    if (next < rows * kRowSeconds && !last) continue;
    const Statistics s = slam.statistics();
    const double mb = resident_mb(), in_use = in_use_mb();
    csv += fmt::format("{:.0f},{},{},{},{},{:.1f},{:.1f},{:.2f},{:.2f}\n", rows * kRowSeconds, s.keyframes,
                       s.keyframes_inserted, s.map_points, s.loops, mb, in_use, p95(row.times, &FrameTime::tracking_ms),
                       p95(row.times, &FrameTime::cpu_ms));
    row = {};
    ++rows;
    if (next < laps * arguments.period && !last) continue;
    const double cpu = p95(lap.times, &FrameTime::cpu_ms);
    if (laps == 1) first_cpu_p95 = cpu;
    fmt::print("| {} | {:.1f} | {} | {} | {} | {} | {:.0f} | {:.0f} | {:.2f} | {:.2f} | {:.2f} |\n", laps,
               100.0 * lap.tracked / static_cast<double>(lap.times.size()), s.keyframes, s.keyframes_inserted,
               s.map_points, s.loops, mb, in_use, p95(lap.times, &FrameTime::tracking_ms), cpu, cpu / first_cpu_p95);
    std::fflush(stdout);
    if (!arguments.csv.empty()) write_file_atomically(arguments.csv, csv);
    lap = {};
    ++laps;
  }
  slam.finish();
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--laps" && i + 1 < argc) {
      arguments.laps = std::max(1, std::atoi(argv[++i]));
    } else if (word == "--period" && i + 1 < argc) {
      arguments.period = std::atof(argv[++i]);
    } else if (word == "--csv" && i + 1 < argc) {
      arguments.csv = argv[++i];
    } else if (!word.starts_with("--") && arguments.folder.empty()) {
      arguments.folder = word;
    } else {
      throw std::runtime_error("usage: soak_bench [--laps N] [--period SECONDS] [--csv FILE] FOLDER");
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
