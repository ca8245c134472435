// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>

#include "bench/bench_cv_orb.h"
#include "dense_output.h"
#include "detector_choice.h"
#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/map/map_file.h"
#include "dkb/slam/slam_system.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/log.h"
#include "dkb/util/settings.h"
#include "run_outputs.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

struct RunArguments {
  std::string dataset, camera, preset = "default", out;
  std::vector<std::string> set;
  std::string config;
  DatasetSelection selection;
  uint64_t seed = 1;
  bool has_seed = false;
  int threads = 0;
  DetectorArguments detection;
  std::string filter, disable;
  std::string load_map;
  bool localise = false;
  bool realtime = false, dense = false, final_ba = false, dump_features = false, debug_log = false, cv_orb = false,
       quiet = false;
};

std::atomic<bool> interrupted{false};
void on_interrupt(int) {
  interrupted = true;
}

// One line that renews itself on a terminal; plain lines now and then elsewhere.
class Progress {
 public:
  Progress(size_t total, bool quiet) : total_(total), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}
  void frame(size_t done, const FrameResult* result) {
    if (quiet_) return;
    const double ms = watch_.ms();
    if (done < total_ && ms - last_ms_ < (terminal_ ? 100 : 5000)) return;
    last_ms_ = ms;
    const double rate = ms > 0 ? 1000.0 * static_cast<double>(done) / ms : 0;
    const double eta = rate > 0 ? static_cast<double>(total_ - done) / rate : 0;
    std::string line = fmt::format("frame {}/{}  {:.0f} frames/s  ETA {:.0f} s", done, total_, rate, eta);
    if (result != nullptr) line += fmt::format("  {} {} inliers", name_of(result->state), result->inliers);
    if (terminal_)
      fmt::print(stderr, "\r\033[K{}{}", line, done >= total_ ? "\n" : "");
    else
      fmt::print(stderr, "{}\n", line);
    std::fflush(stderr);
  }

 private:
  size_t total_;
  bool quiet_, terminal_;
  double last_ms_ = -1e9;
  Stopwatch watch_;
};

fs::path default_output(const fs::path& dataset) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y%m%d-%H%M%S", &parts);
  const fs::path name = dataset.filename().empty() ? dataset.parent_path().filename() : dataset.filename();
  return fs::path("dkb-out") / (name.string() + "-" + stamp);
}

void append_features(std::string& csv, const std::string& stamp, const SlamSystem& slam) {
  for (const FeatureReport& f : slam.features())
    csv += fmt::format("{},{:.2f},{:.2f},{}\n", stamp, f.image_x, f.image_y, name_of(f.state));
}

void append_frame(std::string& log, const std::string& stamp, const FrameResult& result) {
  log += fmt::format("{} frame {} {}", stamp, result.frame, name_of(result.state));
  if (result.tracked()) log += fmt::format(", {} points; {}", result.inliers, result.keyframe_explanation);
  log += '\n';
}

// What --load-map says of the camera and the pyramid has to fit what the run says of them.
CameraChoice camera_of_map(const MapFileContext& context, const RunArguments& args, const SlamOptions& options) {
  const CameraModel& c = context.camera;
  CameraChoice choice{c, "of " + args.load_map};
  try {
    choice = choose_camera(args.camera, args.dataset);
  } catch (const InputError&) {
    // A folder that does not tell its camera takes the map's.
    if (!args.camera.empty() || fs::exists(fs::path(args.dataset) / "camera.yaml")) throw;
  }
  const CameraModel& d = choice.camera;
  const auto numbers = [](const CameraModel& m) {
    return std::array{m.fx, m.fy, m.cx, m.cy, m.k1, m.k2, m.p1, m.p2, m.k3};
  };
  if (c.width != d.width || c.height != d.height || numbers(c) != numbers(d))
    throw InputError(fmt::format(
        "{}: was made with another camera ({}x{} fx {} fy {} cx {} cy {}) than {} ({}x{} fx {} fy {} cx {} cy {}); "
        "give a map of this camera, or --camera",
        args.load_map, c.width, c.height, c.fx, c.fy, c.cx, c.cy, choice.origin, d.width, d.height, d.fx, d.fy, d.cx,
        d.cy));
  if (context.levels != options.features.levels || context.scale_factor != options.features.scale)
    throw InputError(
        fmt::format("{}: was made with {} pyramid levels of {}; add --set features.levels={} --set "
                    "features.scale={}",
                    args.load_map, context.levels, context.scale_factor, context.levels, context.scale_factor));
  return choice;
}

int run(const RunArguments& args) {
  WarningLog warnings([](const std::string& line) { fmt::print(stderr, "{}\n", line); });
  SlamOptions options = preset(args.preset);
  Settings settings;
  bind_settings(settings, options);
  if (!args.config.empty()) settings.load_yaml(args.config);
  for (const std::string& assignment : args.set) settings.set_assignment(assignment, "--set");
  if (!args.filter.empty()) settings.set("dynamics.filter", args.filter, "--filter");
  DetectorArguments detection = args.detection;
  const DisabledParts disabled = parse_disabled(args.disable);
  disable_parts(options, disabled);
  if (options.dynamics.filter == FilterKind::none && (disabled.dynamic_removal || args.preset == "orb")) detection = {};
  if (options.dynamics.filter == FilterKind::none) {
    detection.detector = "none";
    detection.boxes.clear();
  }
  if (args.has_seed) options.seed = args.seed;
  options.pipeline.threaded = args.threads != 1;
  options.pipeline.realtime = args.realtime;
  if (args.final_ba) options.final_ba = true;
  options.check();

  TumDataset dataset = open_tum_dataset(args.dataset);
  select_pairs(args.selection, &dataset);
  if (args.localise && args.load_map.empty()) throw InputError("--localize: needs a map; give --load-map FILE");
  std::optional<MapFile> map;
  if (!args.load_map.empty()) map = load_map(args.load_map);
  const CameraChoice camera =
      map ? camera_of_map(map->context, args, options) : choose_camera(args.camera, args.dataset);
  RgbdReaderOptions reading;
  reading.threaded = options.pipeline.threaded || args.realtime;
  RgbdReader reader(dataset.pairs, camera.camera, reading, &warnings);
  std::vector<double> stamps;
  for (const DatasetPair& pair : dataset.pairs) stamps.push_back(pair.timestamp);
  const Stopwatch loading;
  DetectorSet detectors = make_detectors(detection, camera.camera, stamps, options.pipeline.threaded, args.realtime);
  const double loading_s = loading.ms() / 1000;
  const fs::path out = args.out.empty() ? default_output(args.dataset) : fs::path(args.out);
  make_output_folder(out);
  if (!args.quiet)
    fmt::print("{} pairs by {}, camera {}, results in {}\n", dataset.pairs.size(), dataset.list, camera.origin,
               out.string());

  interrupted = false;
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  SlamSystem slam(camera.camera, options, std::move(detectors));
  if (map) slam.load(std::move(map->map));
  slam.set_localise_only(args.localise);
  std::optional<DenseOutput> dense;
  if (args.dense) dense.emplace(slam);
  RunFacts facts;
  facts.writes_map = !args.localise;
  facts.offered = static_cast<int>(dataset.pairs.size());
  slam.explain_keyframes(args.debug_log);
  if (args.dump_features) facts.features_csv = "timestamp,x,y,state\n";
  std::optional<PacedSource> paced;
  if (args.realtime) paced.emplace(reader);
  Progress progress(dataset.pairs.size(), args.quiet);
  const Stopwatch wall;
  bool first = true;
  while (!interrupted) {
    const std::optional<DatasetFrame> frame = paced ? paced->next() : reader.next();
    if (!frame) break;
    if (first) facts.startup_s = seconds_since_process_start() - loading_s;
    first = false;
    if (frame->image == nullptr) {
      ++facts.skipped;
      progress.frame(frame->index + 1, nullptr);
      continue;
    }
    facts.stamps.push_back(frame->stamp);
    const FrameResult result = slam.process(frame->image);
    for (const Mover& mover : result.movers) facts.movers.push_back({frame->timestamp, frame->stamp, mover});
    if (dense) dense->note(*frame->image, result, slam);
    if (const auto warning = slam.take_warning())
      warnings.warn("detector", "frame " + std::to_string(frame->index) + ": " + *warning);
    if (args.dump_features) append_features(facts.features_csv, frame->stamp, slam);
    if (args.debug_log) append_frame(facts.debug_log, frame->stamp, result);
    progress.frame(frame->index + 1, &result);
  }
  if (paced) {
    paced->stop();
    facts.skipped += paced->dropped();
  }
  reader.stop();
  slam.finish();
  facts.wall_s = wall.ms() / 1000;
  facts.config_yaml = settings.to_yaml();
  facts.times = reader.times();
  if (dense) {
    const std::string line = dense->write(out, slam);
    if (!args.quiet) fmt::print("{}\n", line);
    facts.times.merge(dense->times());
  }
  write_outputs(out, slam, facts);
  if (args.cv_orb && !interrupted) write_cv_orb(out, measure_cv_orb(dataset.pairs, camera.camera));
  warnings.finish();

  const SlamStatistics s = slam.statistics();
  if (!args.quiet)
    fmt::print("{} of {} frames tracked, {} keyframes, {} map points; tracking {:.1f} ms per frame\n", s.tracked,
               facts.offered, s.keyframes, s.map_points,
               s.stages.contains("tracking") ? s.stages.at("tracking").mean_ms : 0.0);
  if (interrupted) return 130;
  if (s.tracked == 0 && args.localise) {
    fmt::print(stderr, "error: the camera was never found in {}\n", args.load_map);
    return 1;
  }
  if (s.tracked == 0) {
    fmt::print(stderr, "error: tracking never initialised: no frame has {} features with depth\n",
               options.tracking.initial_points);
    return 1;
  }
  return 0;
}

}  // namespace

DisabledParts parse_disabled(const std::string& list) {
  const std::vector<std::string> known = {"dr", "kf", "ba", "loop"};
  DisabledParts parts;
  bool* const switches[] = {&parts.dynamic_removal, &parts.keyframes, &parts.weighted_ba, &parts.loop};
  std::istringstream names(list);
  for (std::string name; std::getline(names, name, ',');) {
    const auto at = std::find(known.begin(), known.end(), name);
    if (at == known.end())
      throw InputError("--disable: there is no part \"" + name + "\"" + did_you_mean(name, known) +
                       "; parts: dr, kf, ba, loop");
    *switches[at - known.begin()] = true;
  }
  return parts;
}

void register_run(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Track a recorded sequence: trajectory, map and statistics");
  command->add_option("dataset", args->dataset, "Folder in TUM layout")->required();
  command->add_option("--camera", args->camera, "Camera file, or fr1, fr2, fr3, bonn");
  command->add_option("--preset", args->preset, "Settings to start from: default, paper, orb");
  command->add_option("--config", args->config, "YAML file of settings, as written to config.yaml");
  command->add_option("--set", args->set, "key=value, any setting of config.yaml; may be repeated");
  command->add_option("--out", args->out, "Folder for the results (default: dkb-out/NAME-TIME)");
  command->add_option("--seed", args->seed, "Seed of every source of randomness")->each([args](const std::string&) {
    args->has_seed = true;
  });
  DetectorArguments& detection = args->detection;
  command->add_option("--detector", detection.detector, "auto, yolo, motion, file, none; several joined by +");
  command->add_option("--model", detection.model, "ONNX file of the yolo detector (else $DKB_SLAM_MODEL)");
  command->add_option("--labels", detection.labels, "Class names of that model, one per line (default: COCO's)");
  command->add_option("--detect-every", detection.every, "[frames] between detections (default: by the model's size)");
  command->add_option("--detect-latency", detection.latency,
                      "[frames] until a detection is used (default: by the model's size)");
  command->add_option("--boxes", detection.boxes, "For --detector file: stamp class x y w h [score] per line");
  command->add_option("--masks", detection.masks, "Folder of masks STAMP.png, 255 = mover");
  command->add_option("--filter", args->filter, "default, paper, box, epipolar, multiview, none");
  command->add_option("--disable", args->disable, "Parts to switch off, by comma: dr, kf, ba, loop");
  command->add_option("--skip-pairs", args->selection.skip_pairs, "Pairs left out at the beginning, before all else");
  command->add_option("--start", args->selection.start, "[s] after the first pair");
  command->add_option("--end", args->selection.end, "[s] after the first pair");
  command->add_option("--max-frames", args->selection.max_frames, "Pairs at most, counted from --start");
  command->add_option("--threads", args->threads, "1 = everything on one thread (the same bytes)");
  command->add_option("--load-map", args->load_map, "map.dkb to go on in; poses are in its world");
  command->add_flag("--localize", args->localise, "Track in that map without changing it");
  command->add_flag("--final-ba", args->final_ba, "Adjust the whole map once more at the end");
  command->add_flag("--realtime", args->realtime, "Frames at the pace of their stamps; never wait for mapping");
  command->add_flag("--dense", args->dense, "Also write the dense map of the still world and its occupancy grid");
  command->add_flag("--dump-features", args->dump_features, "Write features.csv");
  command->add_flag("--debug-log", args->debug_log,
                    "Write debug.log: each frame's state, and why it became a keyframe or did not");
  command->add_flag("--cv-orb", args->cv_orb,
                    "Time OpenCV's ORB on the same images after the run, as a unit of times: cv_orb.json");
  command->add_flag("--quiet", args->quiet, "No progress; warnings and errors are still shown");
  command->callback([args, &exit_code] { exit_code = run(*args); });
}

}  // namespace dkb
