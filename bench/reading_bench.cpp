// SPDX-License-Identifier: Apache-2.0
// How fast a source hands out its frames when nothing is done with them.
//   reading_bench SOURCE [CAMERA]
#include <fmt/format.h>
#include <sys/resource.h>

#include <exception>

#include "dkb/util/timing.h"
#include "dkb_slam/source.h"

int main(int argc, char** argv) try {
  if (argc < 2) {
    fmt::print(stderr, "usage: reading_bench SOURCE [CAMERA]\n");
    return 2;
  }
  dkb::SourceOptions options;
  if (argc > 2) options.camera = argv[2];
  options.threaded = false;  // one core
  const dkb::Stopwatch opening;
  const auto source = dkb::open_source(argv[1], options);
  const double opened_ms = opening.ms();
  const dkb::Stopwatch reading;
  size_t frames = 0;
  for (dkb::SourceFrame next = source->next(); next.state != dkb::SourceState::ended; next = source->next()) ++frames;
  const double seconds = reading.ms() / 1000;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  fmt::print("{} frames in {:.2f} s, {:.0f} frames/s on one core; opened in {:.0f} ms; {} MB at most\n", frames,
             seconds, static_cast<double>(frames) / seconds, opened_ms, usage.ru_maxrss / 1024);
  return 0;
} catch (const std::exception& e) {
  fmt::print(stderr, "error: {}\n", e.what());
  return 1;
}
