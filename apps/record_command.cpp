// SPDX-License-Identifier: Apache-2.0
#include "record_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstring>
#include <exception>
#include <memory>
#include <utility>

#include "dkb/image/rgbd_image.h"
#include "dkb/recordings/pair_writer.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/errors.h"
#include "dkb/util/log.h"
#include "interrupt.h"
#include "live_report.h"
#include "number_check.h"
#include "source_options.h"
#include "terminal.h"

namespace dkb {
namespace {

struct RecordArguments {
  std::string source, out;
  SourceOptions reading;
  bool quiet = false;
};

// Quick enough to keep up with a camera.
PairWriterOptions quick_options(const std::string& out) {
  PairWriterOptions options;
  options.png_level = 1;
  try {
    if (out.ends_with(".mcap") || out.ends_with(".bag")) options.compression = compression_named("lz4");
  } catch (const InputError&) {  // this build has none
  }
  return options;
}

int record(const RecordArguments& args) {
  bool counting = false;  // the line that counts frames is open
  const auto end_line = [&] {
    if (std::exchange(counting, false)) tell(stderr, "\n");
  };
  WarningLog warnings([&](const std::string& line) {
    end_line();
    tell(stderr, "{}\n", line);
  });
  SourceOptions reading = args.reading;
  reading.depth_limits = false;     // those are for whoever reads the recording
  reading.prior = PriorKind::none;  // images are all that is written
  const std::unique_ptr<Source> source = open_source(args.source, reading);
  PairWriterOptions writing = quick_options(args.out);
  writing.warn = [&](const std::string& line) { warnings.warn(line, line); };
  const auto writer = write_pairs(args.out, source->camera(), source->camera().to_yaml(), writing);
  if (!args.quiet) tell(stdout, "{}, into {}; Ctrl-C ends it\n", source->description(), args.out);
  const Interrupt interrupt([&] { source->stop(); });
  const bool terminal = isatty(STDERR_FILENO) != 0 && !args.quiet;
  LiveReport report;
  size_t kept = 0;
  std::exception_ptr failure;  // what was kept so far is not lost by it
  const auto keep_all = [&] {
    for (SourceFrame next = source->next(); next.state != SourceState::ended; next = source->next()) {
      for (const std::string& line : source->take_warnings()) warnings.warn(line, line);
      report.add(next);
      if (next.state == SourceState::unplugged)
        warnings.warn("unplugged", "the camera is gone; waiting for it to come back");
      if (next.state == SourceState::skipped) warnings.warn("skipped", next.note + "; left out");
      if (next.state != SourceState::frame) continue;
      const RgbdImage& image = *next.frame.image();
      const Picture picture{image.grey, image.colour};
      writer->add({next.frame.stamp_ns(), next.frame.depth_stamp_ns(), {}, &picture, &image.depth});
      if (++kept % 30 != 0 || !terminal) continue;
      tell(stderr, "\r\033[K{} frames", kept);
      counting = true;
    }
  };
  bool full = false;
  try {
    keep_all();
  } catch (const OutputError&) {
    failure = std::current_exception();
    full = true;
  } catch (...) {
    failure = std::current_exception();
  }
  end_line();
  for (const std::string& line : source->take_warnings()) warnings.warn(line, line);
  source->stop();
  warnings.finish();
  if (kept == 0) {
    if (failure) std::rethrow_exception(failure);
    tell(stderr, "error: {} gave no frame; nothing was written\n", args.source);
    return Interrupt::happened() ? 130 : 1;
  }
  try {
    if (!full) writer->close();
  } catch (const OutputError&) {
    if (!failure) failure = std::current_exception();
    full = true;
  }
  if (full) writer->salvage();
  if (full) warnings.warn("full", args.out + " could not be written to the end; what is whole was kept");
  if (!args.quiet) tell(stdout, "{}: {}\n", args.out, report.text(source->counts()));
  if (failure) std::rethrow_exception(failure);
  return Interrupt::happened() ? 130 : 0;
}

void list_sources() {
  for (const SourceKind& kind : source_kinds()) {
    const std::string missing = kind.why_not();
    tell(stdout, "{:<44}{}{}\n", kind.form, kind.live ? "live" : "recorded",
         missing.empty() ? "" : "; not available: " + missing);
    if (!missing.empty()) continue;
    try {
      for (const std::string& device : kind.devices()) tell(stdout, "    {}\n", device);
    } catch (const InputError& e) {
      tell(stdout, "    {}\n", e.what());
    }
  }
}

}  // namespace

void register_record(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<RecordArguments>();
  CLI::App* command = app.add_subcommand("record", "Keep what a camera sees, without loss");
  command->add_option("source", args->source, "A camera, or any other source; `dkb-slam sources` lists them")
      ->required();
  command->add_option("--out", args->out, "New folder in TUM layout, FILE.mcap or FILE.bag")->required();
  add_source_options(*command, args->reading);
  command->add_option("--max-frames", args->reading.max_frames, "Frames at most")->transform(whole_number<int64_t>());
  command->add_flag("--quiet", args->quiet, "No progress; warnings and errors are still shown");
  command->callback([args, &exit_code] { exit_code = record(*args); });
}

void register_sources(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("sources", "List the kinds of sources, whether they can be used, and the cameras seen");
  command->callback([&exit_code] {
    list_sources();
    exit_code = 0;
  });
}

}  // namespace dkb
