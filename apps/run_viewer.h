// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/source.h"
#include "dkb_slam/viewer.h"

namespace dkb {

// The options of the live page and of recording the session, on any command that tracks.
struct ViewerArguments {
  bool on = false, exit = false, record = false, has_host = false;
  int port = 8090;
  std::string host = "127.0.0.1";
};
void add_viewer_options(CLI::App& command, ViewerArguments& args);
// The words of a command line, the port put in where `--viewer` stands without one.
std::vector<std::string> with_default_port(int argc, char** argv);

// The live page of one run, the recording of its session in `out`, or both.
class RunViewer {
 public:
  // Opens what is asked for and prints the page's address on stderr. Throws InputError when this build has no page, or
  // the port is taken. Ground truth beside `source` in TUM layout is shown too.
  RunViewer(const ViewerArguments& args, const Source& source, const std::string& source_name, const Options& options,
            std::filesystem::path out);

  // Before a frame is taken: waits while the page says so, calling `hold` with true first and with false at last; saves
  // the map when it is asked to. A run that is interrupted waits no longer.
  void wait_turn(const Slam& slam, const std::function<void(bool)>& hold);
  double paused_s() const { return paused_s_; }  // that it has waited so
  void show(FrameResult result, const Frame& frame, const Slam& slam, std::vector<Event> events);
  void skipped(size_t frames) { viewer_->skipped(frames); }
  void say(const std::string& line) { viewer_->say(line); }
  std::vector<std::string> take_warnings() { return viewer_->take_warnings(); }
  // The run has ended: goes on serving until the interrupt, unless --viewer-exit.
  void serve_on(const Slam& slam, bool quiet);

 private:
  void save_if_asked(const Slam& slam);

  const bool serves_, exit_;
  const std::filesystem::path out_;
  std::unique_ptr<Viewer> viewer_;
  double paused_s_ = 0;
};

}  // namespace dkb
