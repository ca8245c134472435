// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>

#include "bench/bench_cv_orb.h"
#include "dkb/dataset/detector_choice.h"
#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/odometry_track.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/map/map_file.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/log.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"
#include "dkb_slam/slam.h"
#include "interrupt.h"
#include "live_report.h"
#include "report/run_report.h"
#include "run_outputs.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

struct RunArguments {
  std::string source, preset = "default", out;
  std::vector<std::string> set;
  std::string config;
  SourceOptions reading;
  std::string prior = "auto";
  uint64_t seed = 1;
  bool has_seed = false;
  int threads = 0;
  DetectorChoice detection;
  std::string filter, disable;
  std::string load_map, prior_file;
  bool localize = false;
  bool live = false;  // by the command `live`
  bool realtime = false, dense = false, final_ba = false, dump_features = false, debug_log = false, cv_orb = false,
       quiet = false;
};

// One line that renews itself on a terminal; plain lines now and then elsewhere.
class Progress {
 public:
  // `total`: about how many frames there are.
  Progress(std::optional<size_t> total, bool quiet)
      : total_(total), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}
  void frame(size_t done, const FrameResult* result) {
    if (quiet_) return;
    const double ms = watch_.ms();
    if (done != total_ && ms - last_ms_ < (terminal_ ? 100 : 5000)) return;
    last_ms_ = ms;
    const double rate = ms > 0 ? 1000.0 * static_cast<double>(done) / ms : 0;
    std::string line = fmt::format("frame {}", done);
    if (total_) line += fmt::format("/{}", std::max(*total_, done));
    line += fmt::format("  {:.0f} frames/s", rate);
    if (total_ && rate > 0)
      line += fmt::format("  ETA {:.0f} s", static_cast<double>(*total_ - std::min(*total_, done)) / rate);
    if (result != nullptr) line += fmt::format("  {} {} inliers", name_of(result->state), result->inliers);
    if (terminal_)
      fmt::print(stderr, "\r\033[K{}", line);
    else
      fmt::print(stderr, "{}\n", line);
    std::fflush(stderr);
    open_line_ = terminal_;
  }
  void finish() {
    if (open_line_) fmt::print(stderr, "\n");
    open_line_ = false;
  }

 private:
  std::optional<size_t> total_;
  bool quiet_, terminal_, open_line_ = false;
  double last_ms_ = -1e9;
  Stopwatch watch_;
};

std::string source_name(const fs::path& source) {
  const fs::path name = source.filename().empty() ? source.parent_path().filename() : source.filename();
  if (is_live(source.string())) return source.string().substr(0, source.string().find(':'));
  return (fs::is_regular_file(source) ? name.stem() : name).string();
}

fs::path default_output(const fs::path& source) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y%m%d-%H%M%S", &parts);
  return fs::path("dkb-out") / (source_name(source) + "-" + stamp);
}

void append_features(std::string& csv, const std::string& stamp, const FrameResult& result) {
  for (const FeatureReport& f : result.features)
    csv += fmt::format("{},{:.2f},{:.2f},{}\n", stamp, f.image_x, f.image_y, name_of(f.state));
}

void append_frame(std::string& log, const std::string& stamp, const FrameResult& result) {
  log += fmt::format("{} frame {} {}", stamp, result.frame, name_of(result.state));
  if (result.tracked()) log += fmt::format(", {} points; {}", result.inliers, result.keyframe_explanation);
  log += '\n';
}

Options options_of(const RunArguments& args) {
  Options options(args.preset);
  if (!args.config.empty()) options.load(args.config);
  for (const std::string& assignment : args.set) options.assign(assignment, "--set");
  if (!args.filter.empty()) options.set("dynamics.filter", args.filter, "--filter");
  options.disable(args.disable);
  if (args.has_seed) options.set("seed", std::to_string(args.seed), "--seed");
  if (args.final_ba) options.set("global_ba.final", "true", "--final-ba");
  options.threaded = args.threads != 1;
  options.realtime = args.realtime || is_live(args.source);
  options.dense_map = args.dense;
  options.check();
  return options;
}

PriorKind prior_kind(const std::string& name) {
  const std::vector<std::string> names = {"none", "odom", "imu", "auto"};
  constexpr PriorKind kinds[] = {PriorKind::none, PriorKind::odometry, PriorKind::imu, PriorKind::automatic};
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw InputError("--prior: there is no \"" + name + "\"" + did_you_mean(name, names) + "; none, odom, imu, auto");
  return kinds[found - names.begin()];
}

std::unique_ptr<Source> open_source(const RunArguments& args, bool threaded) {
  SourceOptions options = args.reading;
  options.threaded = threaded;
  // What is given is not to be mixed with what the recording holds.
  options.prior = args.prior_file.empty() ? prior_kind(args.prior) : PriorKind::none;
  try {
    return open_source(args.source, options);
  } catch (const InputError&) {
    if (args.load_map.empty() || !options.camera.empty()) throw;
    // A source that does not tell its camera takes the map's.
    options.fallback_camera = load_map(args.load_map).context.camera;
    return open_source(args.source, options);
  }
}

// Of up to 60 images, evenly spread over the `pairs` that the run was given.
std::optional<double> cv_orb_of(const RunArguments& args, const Source& source, int pairs) {
  if (const auto* folder = dynamic_cast<const FolderSource*>(&source))
    return measure_cv_orb(folder->pairs(), folder->camera());
  const std::unique_ptr<Source> again = open_source(args, false);
  return measure_cv_orb(*again, static_cast<size_t>(pairs));
}

DetectorChoice detector_choice(const RunArguments& args, const Options& options, const ReaderSource* source) {
  DetectorChoice choice = args.detection;
  if (source != nullptr) choice.stamps_ns = source->stamps_ns();
  return choice_beside(options, args.disable, std::move(choice));
}

report::ReportFacts report_facts(const RunArguments& args, const Source& source, const Options& options,
                                 const Slam& slam, const RunFacts& facts) {
  report::ReportFacts r;
  r.name = source_name(args.source);
  r.source = source.description();
  r.version = version();
  r.camera = source.camera();
  r.realtime = options.realtime;
  r.offered = facts.offered;
  r.skipped = facts.skipped;
  r.wall_s = facts.wall_s;
  r.statistics = statistics_with(slam, facts);
  r.trajectory = trajectories_by_map(slam.trajectory(), facts.stamps).front();
  r.settings = report::changed_settings(options.to_yaml(), Options().to_yaml());
  r.limits = {options.tracking.min_inliers, options.tracking.initial_points, r.camera.fx, r.camera.width};
  r.seed = options.seed;
  r.choices = {{"source", args.source},
               {"camera", fmt::format("{} x {}, fx {:g}, fy {:g}, cx {:g}, cy {:g}", r.camera.width, r.camera.height,
                                      r.camera.fx, r.camera.fy, r.camera.cx, r.camera.cy)},
               {"detector", r.statistics.detector},
               {"preset", options.preset()},
               {"pace", options.realtime ? "real time" : "as fast as it goes, waiting for mapping"}};
  if (!args.load_map.empty()) r.choices.emplace_back(args.localize ? "localised in" : "went on in", args.load_map);
  if (!args.prior_file.empty()) r.choices.emplace_back("motion prior", args.prior_file);
  return r;
}

int run(const RunArguments& args) {
  WarningLog warnings([](const std::string& line) { fmt::print(stderr, "{}\n", line); });
  const Options options = options_of(args);
  if (args.localize && args.load_map.empty()) throw InputError("--localize: needs a map; give --load-map FILE");
  std::unique_ptr<Source> recording = open_source(args, args.threads != 1 || args.realtime);
  const Source& opened = *recording;
  const auto* reader = dynamic_cast<const ReaderSource*>(recording.get());
  if (!args.prior_file.empty()) recording = with_prior(std::move(recording), read_odometry(args.prior_file));
  const Stopwatch loading;
  Detectors detectors = make_detectors(detector_choice(args, options, reader), recording->camera());
  const double loading_s = loading.ms() / 1000;
  Slam slam(recording->camera(), options, std::move(detectors));
  if (!args.load_map.empty()) slam.load_map(args.load_map);
  slam.localize_only(args.localize);
  slam.explain_keyframes(args.debug_log);
  const fs::path out = args.out.empty() ? default_output(args.source) : fs::path(args.out);
  make_output_folder(out);
  if (!args.quiet) fmt::print("{}, results in {}\n", recording->description(), out.string());

  const bool live = is_live(args.source);
  RunFacts facts;
  facts.writes_map = !args.localize;
  if (args.dump_features) facts.features_csv = "timestamp,x,y,state\n";
  report::RunLog log(recording->size());
  std::optional<PacedSource> paced;
  if (args.realtime && !live) paced.emplace(*recording);
  Source& source = paced ? static_cast<Source&>(*paced) : *recording;
  const Interrupt interrupt([&] { source.stop(); });
  LiveReport report;
  Progress progress(recording->size(), args.quiet);
  const auto warn = [&] {
    for (const std::string& line : recording->take_warnings()) warnings.warn(line, line);
  };
  warn();
  const Stopwatch wall;
  std::exception_ptr failure;  // what was tracked until then is written all the same
  const auto track_all = [&] {
    while (!Interrupt::happened()) {
      SourceFrame next = source.next();
      warn();
      if (next.state == SourceState::ended) break;
      if (next.state != SourceState::unplugged) facts.offered = static_cast<int>(next.index) + 1;
      if (facts.startup_s == 0) facts.startup_s = seconds_since_process_start() - loading_s;
      report.add(next);
      if (next.state == SourceState::unplugged) {
        warnings.warn("unplugged", "the camera is gone; waiting for it to come back");
        continue;
      }
      if (next.state != SourceState::frame) {
        ++facts.skipped;
        warnings.warn("frame skipped, an image cannot be read",
                      "frame " + std::to_string(next.index) + ": " + next.note + "; frame skipped");
        progress.frame(next.index + 1, nullptr);
        continue;
      }
      facts.stamps.push_back(next.stamp);
      const FrameResult result = slam.process(next.frame);
      for (const Mover& mover : result.movers)
        facts.movers.push_back({seconds_from_ns(result.stamp_ns), next.stamp, mover});
      log.frame(next.frame, result);
      for (const Event& event : slam.take_events()) {
        log.event(event);
        if (event.kind == Event::Kind::warning)
          warnings.warn("detector", "frame " + std::to_string(next.index) + ": " + event.text);
      }
      if (args.dump_features) append_features(facts.features_csv, next.stamp, result);
      if (args.debug_log) append_frame(facts.debug_log, next.stamp, result);
      progress.frame(next.index + 1, &result);
    }
  };
  try {
    track_all();
  } catch (...) {
    failure = std::current_exception();
  }
  try {
    slam.finish();
  } catch (...) {
    if (!failure) failure = std::current_exception();
  }
  if (failure && slam.statistics().tracked == 0) std::rethrow_exception(failure);
  progress.finish();
  if (Interrupt::happened()) facts.offered = std::max(facts.offered, static_cast<int>(recording->size().value_or(0)));
  source.stop();
  if (paced || live) facts.skipped += static_cast<int>(source.counts().dropped);
  // Nobody knows how many a camera could have given.
  if (live) facts.offered = static_cast<int>(facts.stamps.size()) + facts.skipped;
  facts.wall_s = wall.ms() / 1000;
  facts.config_yaml = options.to_yaml();
  if (reader != nullptr) facts.times = reader->times();
  if (args.dense && !failure) {
    const Stopwatch building;
    const DenseMap map = slam.dense_map();
    facts.times.add("dense_build", building.ms());
    const std::string line = write_dense_map(out, map, building.ms() / 1000);
    if (!args.quiet) fmt::print("{}\n", line);
  }
  write_outputs(out, slam, facts);
  const report::ReportFacts reported = report_facts(args, *recording, options, slam, facts);
  write_file_atomically(out / "report.html",
                        report_html(log, reported, report::truth_beside(args.source, reported.trajectory)));
  if (args.cv_orb && !Interrupt::happened()) write_cv_orb(out, cv_orb_of(args, opened, facts.offered));
  warnings.finish();
  if (failure) std::rethrow_exception(failure);

  const Statistics s = slam.statistics();
  if (!args.quiet)
    fmt::print("{} of {} frames tracked, {} keyframes, {} map points; tracking {:.1f} ms per frame\n", s.tracked,
               facts.offered, s.keyframes, s.map_points,
               s.stages.contains("tracking") ? s.stages.at("tracking").mean_ms : 0.0);
  if (const std::string line = report.text(source.counts()); (live || args.live) && !args.quiet && !line.empty())
    fmt::print("{}\n", line);
  if (const SourceCounts lost = recording->counts(); !live && !args.quiet && lost.unpaired + lost.late > 0)
    fmt::print("{} images without a partner of their time, {} out of order\n", lost.unpaired, lost.late);
  if (Interrupt::happened()) return 130;
  if (s.tracked > 0) return 0;
  if (args.localize)
    fmt::print(stderr, "error: the camera was never found in {}\n", args.load_map);
  else
    fmt::print(stderr, "error: tracking never initialised: no frame has {} features with depth\n",
               options.tracking.initial_points);
  return 1;
}

}  // namespace

namespace {

// The options that `run` and `live` have in common.
void add_options(CLI::App* command, const std::shared_ptr<RunArguments>& args) {
  SourceOptions& reading = args->reading;
  command->add_option("--camera", reading.camera, "Camera file, or fr1, fr2, fr3, bonn");
  command->add_option("--preset", args->preset, "Settings to start from: default, paper, orb");
  command->add_option("--config", args->config, "YAML file of settings, as written to config.yaml");
  command->add_option("--set", args->set,
                      "key=value, any setting of config.yaml, or experiment.NAME=value; may be repeated");
  command->add_option("--out", args->out, "Folder for the results (default: dkb-out/NAME-TIME)");
  command->add_option("--seed", args->seed, "Seed of every source of randomness")->each([args](const std::string&) {
    args->has_seed = true;
  });
  DetectorChoice& detection = args->detection;
  command->add_option("--detector", detection.kinds, "auto, yolo, motion, file, none; several joined by +");
  command->add_option("--model", detection.model, "ONNX file of the yolo detector (else $DKB_SLAM_MODEL)");
  command->add_option("--labels", detection.labels, "Class names of that model, one per line (default: COCO's)");
  command->add_option("--detect-every", detection.every, "[frames] between detections (default: by the model's size)");
  command->add_option("--detect-latency", detection.latency,
                      "[frames] until a detection is used (default: by the model's size)");
  command->add_option("--boxes", detection.boxes, "For --detector file: stamp class x y w h [score] per line");
  command->add_option("--masks", detection.masks, "Folder of masks STAMP.png, 255 = mover");
  command->add_option("--filter", args->filter, "default, paper, box, epipolar, multiview, none");
  command->add_option("--disable", args->disable, "Parts to switch off, by comma: dr, kf, ba, loop");
  command->add_option("--skip-pairs", reading.skip_pairs, "Pairs left out at the beginning, before all else");
  command->add_option("--start", reading.start, "[s] after the first pair");
  command->add_option("--end", reading.end, "[s] after the first pair");
  command->add_option("--max-frames", reading.max_frames, "Pairs at most, counted from --start");
  command->add_option("--threads", args->threads, "1 = everything on one thread (the same bytes)");
  command->add_option("--load-map", args->load_map, "map.dkb to go on in; poses are in its world");
  command->add_option("--colour-topic", reading.colour_topic, "Of a recording with several topics of colour images");
  command->add_option("--depth-topic", reading.depth_topic, "Likewise of depth images");
  command->add_option("--info-topic", reading.info_topic, "Likewise of CameraInfo: the one of the colour images");
  command->add_option("--odom-topic", reading.odom_topic, "Likewise of odometry");
  command->add_option("--imu-topic", reading.imu_topic, "Likewise of an inertial unit");
  command->add_option("--prior", args->prior, "What of a recording guides tracking: none, odom, imu, auto");
  command->add_option("--prior-file", args->prior_file,
                      "Wheel odometry in TUM format: guides tracking, and bridges what the images do not tell");
  command->add_flag("--localize", args->localize, "Track in that map without changing it");
  command->add_flag("--final-ba", args->final_ba, "Adjust the whole map once more at the end");
  command->add_flag("--dense", args->dense, "Also write the dense map of the still world and its occupancy grid");
  command->add_flag("--dump-features", args->dump_features, "Write features.csv");
  command->add_flag("--debug-log", args->debug_log,
                    "Write debug.log: each frame's state, and why it became a keyframe or did not");
  command->add_flag("--quiet", args->quiet, "No progress; warnings and errors are still shown");
}

}  // namespace

void register_run(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Track a recorded sequence: trajectory, map and statistics");
  command
      ->add_option("source", args->source,
                   "Folder in TUM or another known layout, FILE.bag, FILE.mcap, FILE.db3 or its folder, FILE.oni")
      ->required();
  add_options(command, args);
  command->add_flag("--realtime", args->realtime, "Frames at the pace of their stamps; never wait for mapping");
  command->add_flag("--cv-orb", args->cv_orb,
                    "Time OpenCV's ORB on the same images after the run, as a unit of times: cv_orb.json");
  command->callback([args, &exit_code] { exit_code = run(*args); });
}

void register_live(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("live", "Track what a camera sees, until Ctrl-C; results as those of run");
  command
      ->add_option("source", args->source,
                   "openni2, realsense, orbbec, each with an optional :PLACE; v4l2:COLOUR,DEPTH; fake:FOLDER; "
                   "`dkb-slam sources` lists them. A recording is played in real time")
      ->required();
  add_options(command, args);
  command->callback([args, &exit_code] {
    args->live = args->realtime = true;
    exit_code = run(*args);
  });
}

}  // namespace dkb
