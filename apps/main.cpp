// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "bench/bench_command.h"
#include "convert_command.h"
#include "dkb/util/errors.h"
#include "dkb_slam/version.h"
#include "eval/eval_command.h"
#include "export_command.h"
#include "interrupt.h"
#include "map_command.h"
#include "record_command.h"
#include "run_command.h"
#include "run_viewer.h"
#include "simulate_command.h"
#include "usage_text.h"
#include "view_command.h"

namespace {

constexpr int kFailed = 1, kBadInput = 2, kInterrupted = 130;

void print_error(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "error: %s\n", message.c_str());
}

// A reader that goes away (`| head`) is a failed write, not the end of the program; and no file that is opened gets the
// number of an output that was closed, and with it what is printed.
void guard_outputs() {
  std::signal(SIGPIPE, SIG_IGN);
  for (const int fd : {0, 1, 2})
    if (fcntl(fd, F_GETFD) < 0) static_cast<void>(open("/dev/null", O_RDONLY));  // the lowest that is free: `fd`
}

// The exit code, when what was printed did not arrive.
int checked_output(int exit_code) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return exit_code;
  const std::string why = errno != 0 ? std::string(" (") + std::strerror(errno) + ")" : "";
  print_error("standard output: cannot be written" + why + "; files that were asked for are not touched by that");
  return exit_code == 0 ? kFailed : exit_code;
}

int run_command_line(int argc, char** argv) {
  CLI::App app("Real-time RGB-D SLAM that withstands people in the picture (DKB-SLAM)", "dkb-slam");
  app.set_version_flag("--version", "dkb-slam " DKB_SLAM_VERSION);
  app.require_subcommand(1);
  app.formatter(std::make_shared<dkb::HelpFormatter>());
  int exit_code = 0;
  try {
    dkb::register_run(app, exit_code);
    dkb::register_live(app, exit_code);
    dkb::register_view(app, exit_code);
    dkb::register_record(app, exit_code);
    dkb::register_sources(app, exit_code);
    dkb::register_eval(app, exit_code);
    dkb::register_simulate(app, exit_code);
    dkb::register_map(app, exit_code);
    dkb::register_convert(app, exit_code);
    dkb::register_export(app, exit_code);
    dkb::register_bench(app, exit_code);
    std::vector<std::string> words = dkb::with_default_port(argc, argv);
    std::reverse(words.begin(), words.end());  // as CLI11 wants them
    app.parse(words);
  } catch (const CLI::ParseError& e) {
    const bool help = e.get_exit_code() == 0;  // or the version
    if (help && !dkb::asks_for_unknown_command(app)) return app.exit(e);
    print_error(dkb::usage_error(app, e));
    return kBadInput;
  } catch (const dkb::InterruptedError& e) {
    print_error(e.what());
    return kInterrupted;
  } catch (const dkb::OutputError& e) {
    print_error(e.what());
    return kFailed;
  } catch (const dkb::InputError& e) {
    print_error(e.what());
    return kBadInput;
  } catch (const std::exception& e) {
    print_error(e.what());
    return kFailed;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
#if defined(M_ARENA_MAX)
  // Images are made in one thread and given back in another, some every frame. A heap for every thread would keep room
  // for them in each, and room that is given back to the system costs a page fault for every 4 kB when it is asked for
  // again: together 8 MB and a twentieth of all processor time. A dozen images of 640 x 480 are kept: with 6 MB there
  // were 20,000 page faults on freiburg1_xyz in the place of 7,500, and the highest use is the same.
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, 4 << 20);
  mallopt(M_TRIM_THRESHOLD, 16 << 20);
#endif
  guard_outputs();
  return checked_output(run_command_line(argc, argv));
}
