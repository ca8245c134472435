// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dkb/dataset/paced_source.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/detection/mask_folder.h"
#include "dkb/evaluation/trajectory_error.h"
#include "dkb/util/folder_lock.h"
#include "dkb/util/log.h"
#include "dkb/util/new_folder.h"
#include "dkb/util/timing.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"
#include "frame_files.h"
#include "interrupt.h"
#include "live_report.h"
#include "progress.h"
#include "report/run_report.h"
#include "run_outputs.h"
#include "run_viewer.h"

namespace dkb {

class ReaderSource;

// What the options of `run` and `live` say.
struct RunArguments {
  std::string source, preset = "default", out;
  std::vector<std::string> set;
  std::string config;
  SourceOptions reading;
  std::string prior = "auto";
  uint64_t seed = 1;
  bool has_seed = false, has_preset = false;  // given, not by default
  int threads = 0;
  DetectorChoice detection;
  std::string filter, disable;
  std::string load_map, prior_file;
  ViewerArguments viewer;
  bool localize = false;
  bool live = false;  // by the command `live`
  bool realtime = false, dense = false, final_ba = false, dump_features = false, dump_boxes = false, debug_log = false,
       cv_orb = false, quiet = false;
};

// Refuses options that contradict each other. Throws InputError.
void check_arguments(const RunArguments& args, const Options& options);
// Throws InputError for an option that is for a detector which was not chosen.
void check_detector(const DetectorChoice& choice, bool has_model);

// Whether no option leaves out a part: of the images of a part, boxes and masks may show nobody.
bool takes_all_images(const RunArguments& args);

// One run of `run` or `live`: a source is opened, tracked to its end or to Ctrl-C, and its results are written.
class RunSession {
 public:
  // Opens the source and makes what tracks it. Throws InputError; nothing is written then.
  explicit RunSession(const RunArguments& args);

  // The process's exit code. When the source or a stage fails in between, what was tracked until then is written all
  // the same, and the error is thrown after that.
  int run();

 private:
  void track();
  std::vector<Event> take_events();
  void tell_depths(const Frame& first);
  void show(const SourceFrame& next, FrameResult result);
  void write(double seconds);
  // Returns the grid, if there is a floor.
  std::optional<OccupancyGrid> write_dense(const Trajectory& trajectory, std::set<std::string>& written);
  int tell_the_end();
  std::string without_new_map() const;
  std::string remedy_without_features() const;
  void warn_of_source();
  void warn_of_viewer();
  void warn_of_unused();
  void warn_of_stray_boxes();
  void warn_of_darkness(const Frame& frame);
  void warn_of_dropped(size_t next_index);

  RunArguments args_;
  WarningLog warnings_;
  Options options_;
  std::unique_ptr<Source> recording_;
  const Source& opened_;        // without the priors of a file
  const ReaderSource* reader_;  // the same, where it is a recording; else null
  bool live_;
  double loading_s_ = 0;  // of the detectors
  std::optional<Slam> slam_;
  NewFolders made_;
  std::filesystem::path out_;
  std::optional<FolderLock> lock_;  // of it
  std::optional<FrameFiles> files_;
  std::optional<PacedSource> paced_;  // in real time
  Source* source_ = nullptr;          // that frames are taken from
  std::optional<Interrupt> interrupt_;
  int64_t dropped_ = 0;  // frames of it that were told
  std::unique_ptr<RunViewer> viewer_;

  RunFacts facts_;
  std::optional<report::RunLog> log_;
  std::shared_ptr<const FileDetector> boxes_;  // where there are any
  std::set<double> boxed_;                     // stamps [s] of them that a frame had
  std::shared_ptr<const MaskFolder> masks_;    // where there are any
  size_t without_mask_ = 0;                    // frames that none of them belongs to
  bool had_prior_ = false;
  int brightest_ = 0;         // grey of the first frames
  size_t most_features_ = 0;  // of a frame
  size_t on_movers_ = 0;      // of these
  LiveReport camera_;
  std::optional<Progress> progress_;
  std::exception_ptr failure_;
  std::optional<ErrorStatistics> ape_;  // of translations [m], where there is a ground truth
  std::string interrupted_;             // after how many frames; empty when it was not
};

}  // namespace dkb
