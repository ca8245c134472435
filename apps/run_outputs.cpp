// SPDX-License-Identifier: Apache-2.0
#include "run_outputs.h"

#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/map/map_file.h"
#include "dkb/map/point_cloud.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

double peak_rss_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024.0;
  return 0;
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

Trajectory with_stamps(const std::vector<TrajectoryFrame>& frames, const std::vector<std::string>& stamps) {
  Trajectory result;
  for (const TrajectoryFrame& f : frames)
    result.push_back({f.timestamp, stamps.at(static_cast<size_t>(f.frame)), f.world_from_cam});
  return result;
}

std::string stats_json(const SlamStatistics& s, const RunFacts& facts) {
  nlohmann::ordered_json j;
  j["frames"] = facts.offered;
  j["tracked"] = s.tracked;
  j["lost"] = s.lost;
  j["skipped"] = facts.skipped;
  j["keyframes"] = s.keyframes;
  j["keyframes_inserted"] = s.keyframes_inserted;
  j["map_points"] = s.map_points;
  j["maps"] = s.keyframes > 0 ? 1 : 0;
  j["merges"] = 0;
  j["loops"] = 0;
  j["relocalisations"] = s.relocalisations;
  j["startup_s"] = facts.startup_s;
  j["wall_s"] = facts.wall_s;
  j["cpu_s"] = cpu_seconds();
  j["peak_rss_mb"] = peak_rss_mb();
  StageTimes times = facts.times;
  auto stages = times.summaries();
  stages.insert(s.stages.begin(), s.stages.end());
  for (const auto& [name, stage] : stages)
    j["stages"][name] = {{"mean_ms", stage.mean_ms},
                         {"median_ms", stage.median_ms},
                         {"p95_ms", stage.p95_ms},
                         {"max_ms", stage.max_ms},
                         {"count", stage.count}};
  for (const char* rule : {"first", "adaptive", "floor", "baseline"}) {
    const auto it = s.keyframe_rules.find(rule);
    j["keyframe_rules"][rule] = it == s.keyframe_rules.end() ? 0 : it->second;
  }
  j["dynamic"] = {{"features_removed", s.features_removed}, {"points_retracted", s.mapping.points_retracted}};
  j["detector"] = {
      {"kind", s.detector}, {"rate_hz", s.detector_rate_hz}, {"latency_frames", s.detector_latency_frames}};
  j["mapping"] = {{"points_created", s.mapping.points_created},
                  {"points_culled", s.mapping.points_culled},
                  {"points_fused", s.mapping.points_fused},
                  {"keyframes_culled", s.mapping.keyframes_culled}};
  return j.dump(2) + "\n";
}

}  // namespace

double seconds_since_process_start() {
  std::ifstream stat("/proc/self/stat");
  std::string line;
  std::getline(stat, line);
  std::istringstream fields(line.substr(line.rfind(')') + 1));  // the name may hold spaces
  std::string field;
  for (int i = 3; i <= 22 && fields >> field; ++i) {
  }
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) -
         std::stod(field) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

void write_outputs(const std::filesystem::path& folder, const SlamSystem& slam, const RunFacts& facts) {
  write_trajectory(folder / "trajectory.txt", with_stamps(slam.trajectory(), facts.stamps));
  write_trajectory(folder / "trajectory_online.txt", with_stamps(slam.online_trajectory(), facts.stamps));
  write_trajectory(folder / "keyframes.txt", with_stamps(slam.keyframes(), facts.stamps));
  const MapView map = slam.map();
  const auto& orb = slam.options().features;
  save_map(folder / "map.dkb", *map, {slam.camera(), orb.scale, orb.levels});
  write_file_atomically(folder / "map.ply", point_cloud_ply(*map));
  write_file_atomically(folder / "config.yaml", facts.config_yaml);
  write_movers(folder / "movers.csv", facts.movers);
  if (!facts.features_csv.empty()) write_file_atomically(folder / "features.csv", facts.features_csv);
  write_file_atomically(folder / "stats.json", stats_json(slam.statistics(), facts));
}

}  // namespace dkb
