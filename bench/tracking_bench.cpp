// SPDX-License-Identifier: Apache-2.0
// The whole system on whole sequences: time per frame in units of OpenCV's ORB, accuracy, memory, as a Markdown table.
//
//   tracking_bench [--seeds N] [--realtime] [--frames N] [FOLDER ...]
//
// FOLDERs are in TUM layout. Without any: those of $DKB_DATA (or of the source tree's neighbour), and simulated ones.
// Seed s drops the first s - 1 pairs besides, so that runs differ in earnest. Each run has a process of its own, in
// which cv_orb is measured on the same images right after it.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/evaluation/trajectory_error.h"
#include "dkb/simulator/sequence_writer.h"
#include "dkb/slam/options.h"
#include "dkb/util/stamps.h"
#include "dkb_slam/slam.h"

namespace {

namespace fs = std::filesystem;
using namespace dkb;

struct Arguments {
  int seeds = 5, frames = 0;
  bool realtime = false;
  std::vector<fs::path> folders;
};

// Plain numbers: they cross a pipe.
struct Measured {
  int pairs = 0, tracked = 0, keyframes = 0;
  double cv_orb_ms = 0, tracking_mean_ms = 0, tracking_p95_ms = 0, local_ba_ms = 0, mapping_p95_ms = 0, latency_ms = 0;
  double ape_final = 0, ape_online = 0, peak_mb = 0;
};

double peak_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024.0;
  return 0;
}

double cv_orb_ms(const std::vector<DatasetPair>& pairs, const CameraModel& camera) {
  cv::setNumThreads(1);
  const auto orb = cv::ORB::create(1000);
  RgbdReader reader(pairs, camera, {});
  double sum = 0;
  int frames = 0;
  while (const auto frame = reader.next()) {
    if (!frame->image) continue;
    const GreyImage& grey = frame->image->grey;
    const cv::Mat mat(grey.height(), grey.width(), CV_8U, const_cast<uint8_t*>(grey.data()));
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    const Stopwatch watch;
    orb->detectAndCompute(mat, cv::noArray(), keypoints, descriptors);
    sum += watch.ms();
    ++frames;
  }
  return frames > 0 ? sum / frames : 0;
}

double ape(const Trajectory& truth, const std::vector<TrajectoryFrame>& frames) {
  Trajectory estimate;
  for (const TrajectoryFrame& f : frames) estimate.push_back({seconds_from_ns(f.stamp_ns), "", f.world_from_cam});
  return estimate.size() < 2 ? std::nan("") : evaluate(truth, estimate).ape.translation.rmse;
}

Measured measure(const fs::path& folder, int seed, const Arguments& arguments) {
  SourceOptions chosen;
  chosen.skip_pairs = seed - 1;
  if (arguments.frames > 0) chosen.max_frames = arguments.frames;
  FolderSource recorded(folder, chosen);
  const Camera camera = recorded.camera();
  Options options;
  options.seed = static_cast<uint64_t>(seed);
  options.realtime = arguments.realtime;
  std::optional<PacedSource> paced;
  if (arguments.realtime) paced.emplace(recorded);
  Source& source = paced ? static_cast<Source&>(*paced) : recorded;
  Slam slam(camera, options, Detectors::none());
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next())
    if (next.state == SourceState::frame) slam.process(next.frame);
  slam.finish();

  Measured m;
  const Statistics s = slam.statistics();
  m.peak_mb = peak_mb();
  m.pairs = static_cast<int>(recorded.pairs().size());
  m.tracked = s.tracked;
  m.keyframes = s.keyframes;
  const auto stage = [&](const char* name) { return s.stages.contains(name) ? s.stages.at(name) : StageSummary(); };
  m.tracking_mean_ms = stage("tracking").mean_ms;
  m.tracking_p95_ms = stage("tracking").p95_ms;
  m.local_ba_ms = stage("local_ba").mean_ms;
  m.mapping_p95_ms = stage("mapping").p95_ms;
  m.latency_ms = expand(options).pipeline.mapper_latency * 1000.0;
  if (fs::exists(folder / "groundtruth.txt")) {
    const Trajectory truth = read_trajectory(folder / "groundtruth.txt");
    m.ape_final = ape(truth, slam.trajectory());
    m.ape_online = ape(truth, slam.online_trajectory());
  }
  m.cv_orb_ms = cv_orb_ms(recorded.pairs(), camera);
  return m;
}

// Runs measure() in a child process, so that peak memory is that of this run alone.
Measured measure_apart(const fs::path& folder, int seed, const Arguments& arguments) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot fork");
  if (child == 0) {
    int code = 1;
    try {
      const Measured m = measure(folder, seed, arguments);
      code = write(ends[1], &m, sizeof m) == static_cast<ssize_t>(sizeof m) ? 0 : 1;
    } catch (const std::exception& e) {
      fmt::print(stderr, "error: {}\n", e.what());
    }
    _exit(code);
  }
  close(ends[1]);
  Measured m;
  const bool whole = read(ends[0], &m, sizeof m) == static_cast<ssize_t>(sizeof m);
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (!whole || status != 0) throw std::runtime_error(folder.string() + ": the run failed");
  return m;
}

template <class Get>
std::vector<double> sorted(const std::vector<Measured>& runs, Get&& get) {
  std::vector<double> values;
  for (const Measured& m : runs) values.push_back(get(m));
  std::sort(values.begin(), values.end());
  return values;
}
double median(const std::vector<double>& v) {
  return v[v.size() / 2];
}

void print_header(const Arguments& arguments) {
  fmt::print(
      "Median / worst of {} runs{}. Times in cv_orb; mapping p95 as a share of the mapper's latency; APE in "
      "metres.\n\n",
      arguments.seeds, arguments.realtime ? ", paced by the stamps" : "");
  fmt::print(
      "| sequence, pairs | tracked % | cv_orb ms | tracking mean | tracking p95 | local BA | mapping p95 | APE final | "
      "APE online "
      "| MB | keyframes |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
}

void print_row(const std::string& name, const std::vector<Measured>& runs) {
  const auto both = [&](auto&& get, const char* format) {
    const auto v = sorted(runs, get);
    return fmt::format(fmt::runtime(std::string(format) + " / " + format), median(v), v.back());
  };
  const auto share = sorted(runs, [](const Measured& m) { return -100.0 * m.tracked / m.pairs; });
  fmt::print("| {}, {} | {:.1f} / {:.1f} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", name, runs[0].pairs,
             -median(share), -share.back(),
             fmt::format("{:.2f}", median(sorted(runs, [](const Measured& m) { return m.cv_orb_ms; }))),
             both([](const Measured& m) { return m.tracking_mean_ms / m.cv_orb_ms; }, "{:.2f}"),
             both([](const Measured& m) { return m.tracking_p95_ms / m.cv_orb_ms; }, "{:.2f}"),
             both([](const Measured& m) { return m.local_ba_ms / m.cv_orb_ms; }, "{:.2f}"),
             both([](const Measured& m) { return m.mapping_p95_ms / m.latency_ms; }, "{:.2f}"),
             both([](const Measured& m) { return m.ape_final; }, "{:.4f}"),
             both([](const Measured& m) { return m.ape_online; }, "{:.4f}"),
             both([](const Measured& m) { return m.peak_mb; }, "{:.0f}"),
             both([](const Measured& m) { return static_cast<double>(m.keyframes); }, "{:.0f}"));
  std::fflush(stdout);
}

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--realtime") {
      arguments.realtime = true;
    } else if ((word == "--seeds" || word == "--frames") && i + 1 < argc) {
      (word == "--seeds" ? arguments.seeds : arguments.frames) = std::max(1, std::atoi(argv[++i]));
    } else if (word.starts_with("--")) {
      throw std::runtime_error("usage: tracking_bench [--seeds N] [--realtime] [--frames N] [FOLDER ...]");
    } else {
      arguments.folders.emplace_back(word);
    }
  }
  return arguments;
}

}  // namespace

int main(int argc, char** argv) {
  fs::path made;
  try {
    Arguments arguments = parse(argc, argv);
    std::vector<std::pair<std::string, fs::path>> sequences;
    for (const fs::path& f : arguments.folders)
      sequences.emplace_back(f.filename().empty() ? f.parent_path().filename() : f.filename(), f);
    std::vector<std::string> scenes;
    if (sequences.empty()) {
      const char* data = std::getenv("DKB_DATA");
      for (const char* name : {"rgbd_dataset_freiburg1_xyz", "rgbd_dataset_freiburg3_walking_halfsphere"})
        if (const fs::path f = fs::path(data != nullptr ? data : DKB_NEIGHBOUR_DATA) / name; fs::exists(f / "rgb.txt"))
          sequences.emplace_back(name, f);
      scenes = {"room", "loop", "spin"};
    }
    print_header(arguments);
    const auto run_all = [&](const std::string& name, const fs::path& folder) {
      std::vector<Measured> runs;
      for (int seed = 1; seed <= arguments.seeds; ++seed) runs.push_back(measure_apart(folder, seed, arguments));
      print_row(name, runs);
    };
    for (const auto& [name, folder] : sequences) run_all(name, folder);
    for (const std::string& scene : scenes) {
      made = fs::temp_directory_path() / ("dkb-tracking-bench-" + std::to_string(getpid()));
      SimulatorOptions options;
      options.scene = scene;
      options.frames = arguments.frames;
      write_sequence(Simulator(options), made);
      run_all("simulated " + scene, made);
      fs::remove_all(made);
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    if (!made.empty()) fs::remove_all(made);
    return 2;
  }
  return 0;
}
