// SPDX-License-Identifier: Apache-2.0
#include "run_outputs.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/map/point_cloud.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/files.h"
#include "dkb/util/plural.h"
#include "dkb/util/stamps.h"
#include "frame_files.h"
#include "report/other_maps.h"

namespace dkb {
namespace {

// What every run writes, and what only some do.
constexpr const char* kAlways[] = {
    "trajectory.txt", "trajectory_online.txt", "keyframes.txt", "config.yaml", "stats.json", "report.html"};
constexpr const char* kSometimes[] = {"map.dkb",        "map.ply",      "dense.ply",    "occupancy.pgm",
                                      "occupancy.yaml", "session.dkbs", "features.csv", "detections.txt",
                                      "debug.log",      "movers.csv",   "cv_orb.json"};

// A new folder: of runs that start in one second each has its own.
std::filesystem::path default_output(const std::filesystem::path& source) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y%m%d-%H%M%S", &parts);
  const std::filesystem::path all = "dkb-out";
  make_output_folder(all);
  const std::string name = source_name(source) + "-" + stamp;
  for (int i = 1;; ++i) {
    const std::filesystem::path own = all / (i == 1 ? name : fmt::format("{}-{}", name, i));
    std::error_code error;
    if (std::filesystem::create_directory(own, error)) return own;
    if (!error) continue;
    make_output_folder(own);  // says why it cannot be
    return own;
  }
}

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

// Files of these maps by `name`. Those of maps that are no more would mislead: they go, once all others are written.
void write_by_map(const std::filesystem::path& folder, const std::string& name, const std::string& ending,
                  const std::map<size_t, std::string>& by_map) {
  for (const auto& [map, content] : by_map) write_file_atomically(folder / name_of_map(name, map, ending), content);
  std::vector<std::filesystem::path> stale;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const size_t map = map_of_file(entry.path().filename().string(), name, ending);
    if (map > 0 && !by_map.contains(map)) stale.push_back(entry.path());
  }
  for (const auto& there : stale) std::filesystem::remove(there);
}

void write_trajectories(const std::filesystem::path& folder, const std::string& name,
                        const std::vector<Trajectory>& by_map) {
  std::map<size_t, std::string> texts;
  for (size_t map = 0; map < by_map.size(); ++map)
    if (map == 0 || !by_map[map].empty()) texts[map] = trajectory_to_text(by_map[map]);
  write_by_map(folder, name, ".txt", texts);
}

void write_clouds(const std::filesystem::path& folder, const Map& map) {
  std::map<size_t, std::string> clouds;
  const auto points = points_by_map(map);
  for (size_t i = 0; i < points.size(); ++i)
    if (i == 0 || !points[i].empty()) clouds[i] = point_cloud_ply(map, points[i]);
  write_by_map(folder, "map", ".ply", clouds);
}

// [1/s] of frames with these stamps; 0 where they do not tell.
double frame_rate(const std::vector<std::string>& stamps) {
  if (stamps.size() < 2) return 0;
  const auto first = parse_stamp_ns(stamps.front()), last = parse_stamp_ns(stamps.back());
  if (!first || !last || *last <= *first) return 0;
  return 1e9 * static_cast<double>(stamps.size() - 1) / static_cast<double>(*last - *first);
}

std::string stats_json(const Statistics& s, const RunFacts& facts) {
  nlohmann::ordered_json j;
  j["frames"] = facts.offered;
  j["interrupted"] = facts.interrupted;
  j["tracked"] = s.tracked;
  j["predicted"] = s.predicted;
  j["lost"] = s.lost;
  j["skipped"] = facts.skipped;
  j["keyframes"] = s.keyframes;
  j["keyframes_inserted"] = s.keyframes_inserted;
  j["map_points"] = s.map_points;
  j["maps"] = s.maps;
  j["merges"] = s.merges;
  j["loops"] = s.loops;
  j["relocalisations"] = s.relocalisations;
  j["startup_s"] = facts.startup_s;
  j["wall_s"] = facts.wall_s;
  j["cpu_s"] = cpu_seconds();
  j["peak_rss_mb"] = peak_rss_mb();
  for (const auto& [name, stage] : s.stages)
    j["stages"][name] = {{"mean_ms", stage.mean_ms},
                         {"median_ms", stage.median_ms},
                         {"p95_ms", stage.p95_ms},
                         {"max_ms", stage.max_ms},
                         {"count", stage.count}};
  for (const char* rule : {"first", "adaptive", "floor", "baseline"}) {
    const auto it = s.keyframe_rules.find(rule);
    j["keyframe_rules"][rule] = it == s.keyframe_rules.end() ? 0 : it->second;
  }
  j["keyframe_tests"] = s.keyframe_tests;
  j["timing"] = {{"readout", s.readout}, {"depth_time_offset", s.depth_time_offset}};
  j["dynamic"] = {{"features_removed", s.features_removed}, {"points_retracted", s.points_retracted}};
  // Boxes of a file, masks and motion tell of every frame.
  const bool prompt = s.detector != "none" && s.detector_latency_frames == 0 && s.detector_rate_hz == 0;
  j["detector"] = {{"kind", s.detector},
                   {"rate_hz", prompt ? frame_rate(facts.stamps) : s.detector_rate_hz},
                   {"latency_frames", s.detector_latency_frames}};
  if (!s.detector_inference.empty()) {
    j["detector"]["inference"] = s.detector_inference;
    j["detector"]["model"] = facts.model;
  }
  if (s.detector_failed) j["detector"]["failed"] = true;
  if (facts.dropped) j["realtime"] = {{"dropped", *facts.dropped}, {"degraded_s", s.degraded_s}};
  j["mapping"] = {{"points_created", s.points_created},
                  {"points_culled", s.points_culled},
                  {"points_fused", s.points_fused},
                  {"keyframes_culled", s.keyframes_culled}};
  j["run"] = nlohmann::ordered_json::parse(facts.run_json);
  return j.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace

std::string source_name(const std::filesystem::path& source) {
  if (is_live(source.string())) return source.string().substr(0, source.string().find(':'));
  const std::filesystem::path whole =
      std::filesystem::absolute(source).lexically_normal();  // "." and ".." are no names
  const std::filesystem::path name = whole.filename().empty() ? whole.parent_path().filename() : whole.filename();
  return (std::filesystem::is_regular_file(source) ? name.stem() : name).string();
}

std::filesystem::path make_results_folder(const std::string& out, const std::filesystem::path& source) {
  const std::filesystem::path folder = out.empty() ? default_output(source) : std::filesystem::path(out);
  std::error_code none;
  if (std::filesystem::equivalent(folder, source, none))
    throw InputError("--out " + folder.string() + ": is the folder of the source; choose another");
  make_output_folder(folder);
  const auto refuse = [&](const char* name) {
    if (std::filesystem::is_directory(folder / name, none))
      throw InputError((folder / name).string() +
                       ": is a folder, where runs write a file; remove it, or choose another --out");
  };
  for (const char* name : kAlways) refuse(name);
  for (const char* name : kSometimes) refuse(name);
  return folder;
}

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

Statistics statistics_with(const Slam& slam, const RunFacts& facts) {
  Statistics s = slam.statistics();
  s.stages.merge(facts.times.summaries());
  s.stage_histograms.merge(facts.times.histograms());
  return s;
}

void write_outputs(const std::filesystem::path& folder, const Slam& slam, const std::vector<Trajectory>& trajectories,
                   const RunFacts& facts) {
  write_trajectories(folder, "trajectory", trajectories);
  write_trajectories(folder, "trajectory_online", trajectories_by_map(slam.online_trajectory(), facts.stamps));
  write_trajectories(folder, "keyframes", trajectories_by_map(slam.keyframes(), facts.stamps));
  if (facts.writes_map) {
    slam.save_map(folder / "map.dkb");
    write_clouds(folder, *slam.map().map());
  }
  write_file_atomically(folder / "config.yaml", facts.config_yaml);
}

void write_statistics(const std::filesystem::path& folder, const Slam& slam, const RunFacts& facts) {
  write_file_atomically(folder / "stats.json", stats_json(statistics_with(slam, facts), facts));
}

void remove_earlier_outputs(const std::filesystem::path& folder, const std::set<std::string>& written) {
  std::error_code ignored;
  for (const std::string name : kSometimes) {
    if (!written.contains(name)) std::filesystem::remove(folder / name, ignored);
    std::filesystem::remove(folder / (name + kUnfinished), ignored);
  }
  if (!written.contains("map.ply")) write_by_map(folder, "map", ".ply", {});
}

std::string write_dense_map(const std::filesystem::path& folder, const DenseMap& map, double seconds) {
  write_file_atomically(folder / "dense.ply", mesh_ply(map.mesh));
  std::string line = fmt::format("dense map: {}, {}, {:.1f} s", plural(map.views, "keyframe", "keyframes"),
                                 plural(map.mesh.triangles.size(), "triangle", "triangles"), seconds);
  if (map.map > 0) line += "; of the world of " + name_of_map("trajectory", static_cast<size_t>(map.map), ".txt");
  if (!map.grid) return line + "; no floor in view: no occupancy grid";
  write_file_atomically(folder / "occupancy.pgm", occupancy_pgm(*map.grid));
  write_file_atomically(folder / "occupancy.yaml", occupancy_yaml(*map.grid, "occupancy.pgm"));
  return line;
}

}  // namespace dkb
