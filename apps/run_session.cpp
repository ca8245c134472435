// SPDX-License-Identifier: Apache-2.0
#include "run_session.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <system_error>

#include "bench/bench_cv_orb.h"
#include "dkb/dataset/detector_choice.h"
#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/odometry_track.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/detection/mask_folder.h"
#include "dkb/evaluation/evaluation_report.h"
#include "dkb/map/map_file.h"
#include "dkb/slam/few_features.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/log.h"
#include "dkb/util/plural.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"
#include "dkb_slam/slam.h"
#include "report/other_maps.h"
#include "run_provenance.h"
#include "terminal.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

// Where the setting that a message begins with was given, to stand before the message; empty for a default.
std::string place_of(const RunArguments& args, const std::string& message) {
  const std::string key = message.substr(0, message.find(':'));
  for (const std::string& assignment : args.set)
    if (assignment.starts_with(key + "=")) return "--set: ";
  if (args.config.empty()) return "";
  Settings known;
  double unused = 0;
  known.bind(key, &unused, "");
  for (const SettingLine& line : known.parse_yaml(read_file(args.config), args.config))
    if (line.key == key) return line.where + ": ";
  return "";
}

Options options_of(const RunArguments& args) {
  Options options;
  options.set("preset", args.preset, "--preset");
  if (!args.config.empty()) options.load(args.config);
  for (const std::string& assignment : args.set) options.assign(assignment, "--set");
  if (!args.filter.empty()) options.set("dynamics.filter", args.filter, "--filter");
  options.disable(args.disable, "--disable");
  if (args.has_seed) options.set("seed", std::to_string(args.seed), "--seed");
  if (args.final_ba) options.set("global_ba.final", "true", "--final-ba");
  options.threaded = args.threads != 1;
  options.realtime = args.realtime || is_live(args.source);
  options.dense_map = args.dense;
  try {
    options.check();
  } catch (const InvalidOption& e) {
    throw InputError(place_of(args, e.what()) + e.what());
  }
  return options;
}

std::unique_ptr<Source> open_source(const RunArguments& args, bool threaded) {
  SourceOptions options = args.reading;
  options.threaded = threaded;
  // What is given is not to be mixed with what the recording holds.
  options.prior = args.prior_file.empty() ? prior_kind_named(args.prior, "--prior") : PriorKind::none;
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
  if (source != nullptr && takes_all_images(args)) choice.stamps_ns = source->stamps_ns();
  return choice_beside(options, args.disable, std::move(choice));
}

report::ReportFacts report_facts(const RunArguments& args, const Source& source, const Options& options,
                                 const Slam& slam, const Trajectory& trajectory, const RunFacts& facts) {
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
  r.trajectory = trajectory;
  r.poses_of_map = facts.poses_of_map;
  r.take_map(slam.map());
  r.settings = report::changed_settings(options);
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

// [m] of the depths that an image has.
struct DepthRange {
  double nearest = 0, median = 0, farthest = 0;
};
std::optional<DepthRange> range_of(const DepthImage& image) {
  std::vector<float> depths;
  std::copy_if(image.data(), image.data() + image.size(), std::back_inserter(depths), [](float z) { return z > 0; });
  if (depths.empty()) return {};
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const auto [nearest, farthest] = std::minmax_element(depths.begin(), depths.end());
  return DepthRange{*nearest, *middle, *farthest};
}

// What the first frame's depth image holds, whatever the limits of the camera; empty where that cannot be told.
std::string depths_of(const RunArguments& args) {
  SourceOptions options = args.reading;
  options.depth_limits = options.threaded = false;
  options.prior = PriorKind::none;
  try {
    const std::unique_ptr<Source> again = open_source(args.source, options);
    const SourceFrame first = again->next();
    if (first.state != SourceState::frame) return "";
    const auto range = range_of(first.frame.image()->depth);
    if (!range) return " (the first depth image is empty)";
    return fmt::format(" (the first image holds {:.3g} ... {:.3g} m{})", range->nearest, range->farthest,
                       range->farthest > 100 ? ": millimetres?" : "");
  } catch (const std::exception&) {
    return "";
  }
}

Options checked(const RunArguments& args) {
  Options options = options_of(args);
  check_arguments(args, options);
  return options;
}

template <class Kind>
std::shared_ptr<const Kind> detector_of(const Detectors& detectors) {
  for (const auto& detector : detectors.prompt)
    if (auto found = std::dynamic_pointer_cast<const Kind>(detector)) return found;
  return nullptr;
}

// The detector that reads boxes, when there are any, to see whether they belong to these images. Throws InputError when
// it is known that they do not.
std::shared_ptr<const FileDetector> boxes_of(const RunArguments& args, const Detectors& detectors,
                                             const ReaderSource* reader) {
  auto file = detector_of<FileDetector>(detectors);
  if (!file || file->boxes().empty()) return nullptr;
  const std::vector<int64_t> stamps = reader != nullptr ? reader->stamps_ns() : std::vector<int64_t>();
  if (!takes_all_images(args) || stamps.empty()) return file;
  if (std::none_of(stamps.begin(), stamps.end(), [&](int64_t stamp) { return file->at(stamp) != nullptr; }))
    throw InputError(
        fmt::format("{}: none of its boxes has the stamp of a colour image ({:.6f} is the first); write stamps as in "
                    "rgb.txt",
                    args.detection.boxes.string(), file->boxes().front().timestamp));
  return file;
}

}  // namespace

RunSession::RunSession(const RunArguments& args)
    : args_(args),
      warnings_([this](const std::string& line) {
        if (progress_) progress_->finish();
        tell(stderr, "{}\n", line);
      }),
      options_(checked(args)),
      recording_(open_source(args, args.threads != 1 || args.realtime)),
      opened_(*recording_),
      reader_(dynamic_cast<const ReaderSource*>(recording_.get())),
      live_(is_live(args.source)) {
  if (!args.prior_file.empty()) recording_ = with_prior_file(std::move(recording_), args.prior_file);
  const Stopwatch loading;
  Detectors detectors = make_detectors(detector_choice(args, options_, reader_), recording_->camera());
  loading_s_ = loading.ms() / 1000;
  boxes_ = boxes_of(args, detectors, reader_);
  masks_ = detector_of<MaskFolder>(detectors);
  slam_.emplace(recording_->camera(), options_, std::move(detectors));
  if (!args.load_map.empty()) slam_->load_map(args.load_map);
  slam_->localize_only(args.localize);
  slam_->explain_keyframes(args.debug_log || args.viewer.on || args.viewer.record);
  made_.note(args.out.empty() ? "dkb-out" : args.out);
  out_ = make_results_folder(args.out, args.source);
  if (args.out.empty()) made_.add(out_);
  lock_.emplace(out_);
  if (!args.quiet) tell(stdout, "{}, results in {}\n", recording_->description(), out_.string());

  facts_.writes_map = !args.localize;
  files_.emplace(out_, FrameFiles::Wanted{args.dump_features, args.dump_boxes, args.debug_log});
  log_.emplace(recording_->size());
  if (args.realtime && !live_) paced_.emplace(*recording_);
  source_ = paced_ ? static_cast<Source*>(&*paced_) : recording_.get();
  interrupt_.emplace([this] { source_->stop(); });  // before the page is there, on which somebody may have acted
  if (!args.viewer.on && !args.viewer.record) return;
  try {
    viewer_ = std::make_unique<RunViewer>(args.viewer, *recording_, args.source, options_, out_);
  } catch (const std::exception& e) {
    if (args.viewer.on || !args.live) throw;
    warnings_.warn("session", std::string("the session is not recorded: ") + e.what());
  }
}

int RunSession::run() {
  progress_.emplace(recording_->size(), args_.quiet);
  warn_of_source();
  const Stopwatch wall;
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
    }
  };
  attempt([&] { track(); });
  // Asked once: Ctrl-C while the results of a whole run are written does not make it one that was cut short.
  if (Interrupt::happened()) interrupted_ = fmt::format("interrupted after {} frames; ", facts_.offered);
  attempt([&] { slam_->finish(); });
  for (const Event& event : take_events())
    if (viewer_) viewer_->say(fmt::format("{}: {}", name_of(event.kind), event.text));
  const double seconds = wall.ms() / 1000 - (viewer_ ? viewer_->paused_s() : 0);
  progress_->finish();
  source_->stop();
  if (!failure_ || slam_->statistics().tracked > 0) attempt([&] { write_results([&] { write(seconds); }); });
  lock_.reset();  // a page that is served on does not hold it
  warn_of_unused();
  warnings_.finish();
  if (failure_) std::rethrow_exception(failure_);
  return tell_the_end();
}

void RunSession::track() {
  const auto hold = [&](bool on) {
    if (paced_) paced_->hold(on);
  };
  while (!Interrupt::happened()) {
    if (viewer_) viewer_->wait_turn(*slam_, hold);
    SourceFrame next = source_->next();
    warn_of_source();
    if (next.state == SourceState::ended) break;
    warn_of_dropped(next.index);
    if (next.state != SourceState::unplugged) facts_.offered = static_cast<int>(next.index) + 1;
    if (facts_.startup_s == 0) facts_.startup_s = seconds_since_process_start() - loading_s_;
    camera_.add(next);
    // Of what a camera skips nobody asks: it has no end.
    if (viewer_ && !live_ && next.state != SourceState::unplugged)
      viewer_->skipped(next.index + 1 - facts_.stamps.size() - (next.state == SourceState::frame ? 1 : 0));
    if (next.state == SourceState::unplugged) {
      warnings_.warn("unplugged", "the camera is gone; waiting for it to come back");
    } else if (next.state != SourceState::frame) {
      ++facts_.skipped;
      warnings_.warn("frame skipped, an image cannot be read",
                     "frame " + std::to_string(next.index) + ": " + next.note + "; frame skipped");
      progress_->frame(next.index + 1, nullptr);
    } else {
      facts_.stamps.push_back(next.stamp);
      had_prior_ = had_prior_ || next.frame.prior();
      if (const TimedBoxes* boxes = boxes_ ? boxes_->at(next.frame.stamp_ns()) : nullptr)
        boxed_.insert(boxes->timestamp);
      warn_of_darkness(next.frame);
      if (facts_.stamps.size() == 1) tell_depths(next.frame);
      without_mask_ += masks_ && !masks_->has(next.frame.stamp_ns());
      show(next, slam_->process(next.frame));
    }
  }
}

// A wrong depth factor is seen at once.
void RunSession::tell_depths(const Frame& first) {
  constexpr double kNear = 0.4, kFar = 8;  // [m] few cameras see nearer, or measure farther
  const auto range = range_of(first.image()->depth);
  if (!args_.quiet) progress_->finish();
  if (!range) {
    if (!args_.quiet) tell(stdout, "depth: none in the first frame{}\n", live_ ? "" : depths_of(args_));
    return;
  }
  if (!args_.quiet)
    tell(stdout, "depth {:.2g} to {:.2g} m, median {:.2g}, in the first frame\n", range->nearest, range->farthest,
         range->median);
  if (range->median < kNear || range->median > kFar)
    warnings_.warn("depth factor",
                   fmt::format("depth is {:.2g} m in the median of the first frame: is the camera's depth_factor right "
                               "({:g} per metre; float images are in metres)?",
                               range->median, opened_.camera().depth_factor));
}

// What happened since the last call, told to the report; warnings also to the user.
std::vector<Event> RunSession::take_events() {
  std::vector<Event> events = slam_->take_events();
  for (const Event& event : events) {
    log_->event(event);
    if (event.kind == Event::Kind::warning)  // of one kind when they begin alike
      warnings_.warn(event.text.substr(0, event.text.find(':')),
                     fmt::format("frame {}: {}", facts_.offered - 1, event.text));
  }
  return events;
}

// A frame's result to all who want to know of it.
void RunSession::show(const SourceFrame& next, FrameResult result) {
  log_->frame(next.frame, result);
  std::vector<Event> events = take_events();
  if (result.features.size() > most_features_) {
    most_features_ = result.features.size();
    on_movers_ = static_cast<size_t>(std::count_if(result.features.begin(), result.features.end(),
                                                   [](const auto& f) { return f.reason == FeatureReason::on_mover; }));
  }
  files_->add(next.stamp, result);
  progress_->frame(next.index + 1, &result);
  if (viewer_) viewer_->show(std::move(result), next.frame, *slam_, std::move(events));
  warn_of_viewer();
}

void RunSession::write(double seconds) {
  facts_.interrupted = !interrupted_.empty();
  if (paced_ || live_) {
    facts_.dropped = static_cast<int>(source_->counts().dropped);
    facts_.skipped += *facts_.dropped;
  }
  // Nobody knows how many a camera could have given.
  if (live_) facts_.offered = static_cast<int>(facts_.stamps.size()) + facts_.skipped;
  facts_.wall_s = seconds;
  facts_.config_yaml = options_.to_yaml();
  facts_.run_json = run_json(args_, options_, recording_->camera());
  facts_.model = model_of(args_.detection).filename().string();
  if (reader_ != nullptr) facts_.times = reader_->times();
  std::set<std::string> written;           // of what not every run writes
  if (slam_->statistics().tracked == 0) {  // an earlier map is better than none
    facts_.writes_map = false;
    written.insert({"map.dkb", "map.ply"});
  }
  const std::vector<Trajectory> trajectories = trajectories_by_map(slam_->trajectory(), facts_.stamps);
  for (const Trajectory& t : trajectories) facts_.poses_of_map.push_back(t.size());
  write_outputs(out_, *slam_, trajectories, facts_);
  files_->commit();
  written.merge(files_->names());
  std::optional<OccupancyGrid> grid;
  std::exception_ptr no_dense_map;
  if (args_.dense && !failure_) {
    try {
      grid = write_dense(trajectories.front(), written);
    } catch (...) {
      no_dense_map = std::current_exception();
      written.insert({"dense.ply", "occupancy.pgm", "occupancy.yaml"});  // the error says that earlier ones are kept
    }
  }
  write_statistics(out_, *slam_, facts_);  // with the time that the dense map took
  report::ReportFacts reported = report_facts(args_, *recording_, options_, *slam_, trajectories.front(), facts_);
  if (grid && grid->map == 0) reported.grid = std::move(grid);
  report::Truth truth = report::evaluated_by_truth(args_.source, reported.trajectory);
  write_file_atomically(out_ / "report.html", report_html(*log_, reported, truth));
  if (args_.cv_orb && interrupted_.empty()) {
    std::optional<double> ms;
    try {
      ms = cv_orb_of(args_, opened_, facts_.offered);
    } catch (const std::exception& e) {  // the run itself went well
      warnings_.warn("--cv-orb", std::string("--cv-orb: not measured: ") + e.what());
    }
    write_cv_orb(out_, ms);
    written.insert("cv_orb.json");
  }
  if (viewer_ && args_.viewer.record) written.insert("session.dkbs");
  std::error_code none;
  if (fs::equivalent(args_.load_map, out_ / "map.dkb", none)) written.insert({"map.dkb", "map.ply"});  // not to be lost
  if (facts_.writes_map) written.insert({"map.dkb", "map.ply"});
  remove_earlier_outputs(out_, written);
  if (!truth.note.empty() && !reported.trajectory.empty())
    warnings_.warn("ground truth", truth.note + "; the run is not judged by it");
  if (truth.hidden > 0) warnings_.warn("hidden truth", "groundtruth.txt: " + hidden_text(truth.hidden));
  if (truth.evaluation) ape_ = truth.evaluation->ape.translation;
  if (truth.evaluation && truth.evaluation->wrong_scale)
    warnings_.warn("scale", "groundtruth.txt: " + scale_text(*truth.evaluation->wrong_scale));
  if (no_dense_map) std::rethrow_exception(no_dense_map);
}

std::optional<OccupancyGrid> RunSession::write_dense(const Trajectory& trajectory, std::set<std::string>& written) {
  const Stopwatch building;
  // Of the world of trajectory.txt, unless that holds nothing.
  DenseMap map = trajectory.empty() ? slam_->dense_map() : slam_->dense_map(0);
  facts_.times.add("dense_build", building.ms());
  const std::string line = write_dense_map(out_, map, building.ms() / 1000);
  if (!args_.quiet) tell(stdout, "{}\n", line);
  written.insert("dense.ply");
  if (map.grid) written.insert({"occupancy.pgm", "occupancy.yaml"});
  return std::move(map.grid);
}

int RunSession::tell_the_end() {
  const Statistics s = slam_->statistics();
  const auto say = [&](const std::string& line) {
    if (!args_.quiet) tell(stdout, "{}\n", line);
  };
  const std::string predicted =
      s.predicted > 0 ? fmt::format(" ({} of them predicted, not seen)", s.predicted) : std::string();
  say(fmt::format("{}{} of {} tracked{}, {}, {}; tracking {:.1f} ms per frame", interrupted_, s.tracked,
                  plural(facts_.offered, "frame", "frames"), predicted, plural(s.keyframes, "keyframe", "keyframes"),
                  plural(s.map_points, "map point", "map points"),
                  s.stages.contains("tracking") ? s.stages.at("tracking").mean_ms : 0.0));
  if (ape_) say(fmt::format("APE {:.4f} m against groundtruth.txt (RMSE of {} poses)", ape_->rmse, ape_->count));
  if (const std::string others = other_maps_text(facts_.poses_of_map); !others.empty())
    say(others + (ape_ ? fmt::format("; the APE is of {}", ape_->count) : ""));
  say("report: " + (out_ / "report.html").string());
  if (const std::string line = camera_.text(source_->counts()); (live_ || args_.live) && !line.empty()) say(line);
  if (const SourceCounts lost = recording_->counts(); !live_ && !args_.live && lost.unpaired + lost.late > 0)
    say(fmt::format("{} without a partner of their time, {} out of order", plural(lost.unpaired, "image", "images"),
                    lost.late));
  if (viewer_) viewer_->serve_on(*slam_, args_.quiet);
  warn_of_viewer();
  if (!interrupted_.empty()) return 130;
  if (s.tracked > 0) return 0;
  if (!args_.load_map.empty())
    tell(stderr, "error: the camera was never found in {}{}\n", args_.load_map, without_new_map());
  else
    tell(stderr, "error: tracking never initialised: no frame has {} features with depth{}\n",
         options_.tracking.initial_points, remedy_without_features());
  return 1;
}

// Why no map was begun beside the one that was loaded.
std::string RunSession::without_new_map() const {
  if (args_.localize) return "";
  if (options_.tracking.new_map_after == 0) return "; tracking.new_map_after is 0: no new map is begun";
  return fmt::format(
      "; a new map begins after {:g} s without it, where a frame has {} features with depth "
      "(tracking.new_map_after)",
      options_.tracking.new_map_after, options_.tracking.initial_points);
}

std::string RunSession::remedy_without_features() const {
  const double on_movers =
      most_features_ > 0 ? static_cast<double>(on_movers_) / static_cast<double>(most_features_) : 0;
  std::string why =
      why_few_features(most_features_, on_movers, slam_->statistics().detector, options_.tracking.initial_points);
  if (!why.empty()) return why;
  return fmt::format(
      "; are there depth images, in units of the camera's depth_factor ({} per metre; float images are "
      "in metres)?{}",
      opened_.camera().depth_factor, live_ ? "" : depths_of(args_));
}

}  // namespace dkb
