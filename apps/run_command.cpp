// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <memory>

#include "number_check.h"
#include "run_session.h"
#include "source_options.h"

namespace dkb {
namespace {

// The options that `run` and `live` have in common.
void add_options(CLI::App* command, const std::shared_ptr<RunArguments>& args) {
  SourceOptions& reading = args->reading;
  const auto given = [args](bool RunArguments::*flag) {
    return [args, flag](const std::string&) { (*args).*flag = true; };
  };
  add_source_options(*command, reading);
  command->add_option("--preset", args->preset, "Settings to start from: default, paper, orb")
      ->each(given(&RunArguments::has_preset));
  command->add_option("--config", args->config,
                      "YAML file of settings, as written to config.yaml; its preset and that of --preset must agree");
  command
      ->add_option("--set", args->set,
                   "key=value, any setting of config.yaml, or experiment.NAME=value; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--out", args->out, "Folder for the results (default: dkb-out/NAME-TIME)");
  command
      ->add_option("--seed", args->seed,
                   "Seed of the few random draws; results hardly ever depend on it. Runs that differ: --skip-pairs")
      ->transform(whole_number<uint64_t>())
      ->each(given(&RunArguments::has_seed));
  DetectorChoice& detection = args->detection;
  command->add_option("--detector", detection.kinds,
                      "auto, yolo (network), motion, file, none, exec:COMMAND; several joined by +");
  command->add_option("--model", detection.model, "ONNX file of the yolo detector (else $DKB_SLAM_MODEL)");
  command->add_option("--labels", detection.labels, "Class names of that model, one per line (default: COCO's)");
  command->add_option("--classes", detection.classes,
                      "Those of them that may move, by comma (default: people, pets, and what people carry or ride)");
  command->add_option("--inference", detection.inference,
                      "What computes it: auto (ONNX Runtime where it is found, else OpenCV), onnxruntime, opencv");
  command->add_option("--detect-every", detection.every, "[frames] between detections (default: by the model's size)")
      ->transform(whole_number(1, 10000));
  command
      ->add_option("--detect-latency", detection.latency,
                   "[frames] until a detection is used (default: by the model's size)")
      ->transform(whole_number(1, 10000));
  command->add_option("--boxes", detection.boxes, "For --detector file: stamp class x y w h [score] per line");
  command->add_option("--masks", detection.masks, "Folder of masks STAMP.png, above 0 = mover");
  command->add_option("--filter", args->filter,
                      "default, paper, box, epipolar, multiview, none; default alone writes rows of movers.csv");
  command->add_option("--disable", args->disable, "Parts to switch off, by comma: dr, kf, ba, loop");
  command
      ->add_option("--skip-pairs", reading.skip_pairs,
                   "Pairs left out at the beginning, before all else: 0, 1, 2 ... give runs that differ")
      ->transform(whole_number<int64_t>());
  command->add_option("--start", reading.start, "[s] after the first pair");
  command->add_option("--end", reading.end, "[s] after the first pair");
  command->add_option("--max-frames", reading.max_frames, "Pairs at most, counted from --start")
      ->transform(whole_number<int64_t>());
  command
      ->add_option("--threads", args->threads, "1 = everything on one thread, else one for each part (the same bytes)")
      ->transform(whole_number(0, 1024));
  command->add_option("--load-map", args->load_map, "map.dkb to go on in; poses are in its world");
  command->add_option("--odom-topic", reading.odom_topic, "Of a recording with several topics of odometry");
  command->add_option("--imu-topic", reading.imu_topic, "Likewise of an inertial unit");
  command->add_option("--prior", args->prior, "What of a recording guides tracking: none, odom, imu, auto");
  command->add_option("--prior-file", args->prior_file,
                      "Odometry in TUM format, poses of the camera (x right, y down, z forward) as in trajectory.txt: "
                      "guides tracking, and bridges what the images do not tell");
  command->add_flag("--localize", args->localize, "Track in that map without changing it");
  command->add_flag("--final-ba", args->final_ba, "Adjust the whole map once more at the end");
  command->add_flag("--dense", args->dense, "Also write the dense map of the still world and its occupancy grid");
  command->add_flag("--dump-features", args->dump_features, "Write features.csv");
  command->add_flag("--dump-boxes", args->dump_boxes,
                    "Write detections.txt: the boxes that were used, as --detector file reads them");
  command->add_flag("--debug-log", args->debug_log,
                    "Write debug.log: each frame's state, and why it became a keyframe or did not");
  add_viewer_options(*command, args->viewer);
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
  command->add_flag("--record", args->viewer.record, "Write session.dkbs too, which `dkb-slam view` replays");
  command->callback([args, &exit_code] { exit_code = RunSession(*args).run(); });
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
  args->viewer.record = true;
  command->add_flag("!--no-record", args->viewer.record, "Do not write session.dkbs, which `dkb-slam view` replays");
  command->callback([args, &exit_code] {
    args->live = args->realtime = true;
    exit_code = RunSession(*args).run();
  });
}

}  // namespace dkb
