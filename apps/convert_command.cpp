// SPDX-License-Identifier: Apache-2.0
#include "convert_command.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "dkb/recordings/convert.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/util/errors.h"
#include "dkb/util/log.h"
#include "interrupt.h"

namespace dkb {
namespace {

struct ConvertArguments {
  std::string in, out, compression;
  ConvertOptions options;
};

// Fast ones of those that the format knows and this build has.
Compression default_compression(const std::filesystem::path& out) {
  for (const char* name : {"zstd", "lz4"}) {
    if (out.extension() != ".mcap" && std::string(name) == "zstd") continue;
    try {
      return compression_named(name);
    } catch (const InputError&) {
    }
  }
  return Compression::none;
}

// Refuses what has no say in turning this kind of input into this kind of output.
void check_arguments(const ConvertArguments& arguments) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!fs::exists(arguments.in, error)) return;  // convert() says so
  const bool from_folder = fs::is_directory(arguments.in, error) && !is_rosbag2(arguments.in);
  const bool to_folder = !is_recording_name(arguments.out);
  const auto refuse = [&](const char* option, bool given, const char* of) {
    if (given)
      throw InputError(std::string(option) + ": does nothing when a " + (from_folder ? "folder" : "recording") +
                       " becomes a " + (to_folder ? "folder" : "recording") + ", only for " + of + "; leave it out");
  };
  const fs::path out = arguments.out;
  for (const char* ending : {".zip", ".oni", ".mp4", ".avi", ".mkv", ".tar", ".gz", ".tgz", ".7z", ".db3"})
    if (to_folder && out.extension() == ending && !fs::is_directory(out, error))
      throw InputError(arguments.out + ": " + ending +
                       " is nothing that is written; give FILE.bag, FILE.mcap or the name of a folder");
  const SourceOptions& source = arguments.options.source;
  if (to_folder) refuse("--compression", !arguments.compression.empty(), "a recording that is written");
  if (!from_folder) refuse("--raw", arguments.options.raw, "a folder that is read");
  if (!from_folder && to_folder) return;
  refuse("--colour-topic", !source.colour_topic.empty(), "a recording that becomes a folder");
  refuse("--depth-topic", !source.depth_topic.empty(), "a recording that becomes a folder");
  refuse("--info-topic", !source.info_topic.empty(), "a recording that becomes a folder");
}

void run_convert(const ConvertArguments& arguments) {
  check_arguments(arguments);
  ConvertOptions options = arguments.options;
  WarningLog warnings([](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); });
  options.warn = [&](const std::string& line) { warnings.warn(line, line); };
  try {
    options.compression =
        arguments.compression.empty() ? default_compression(arguments.out) : compression_named(arguments.compression);
  } catch (const InputError& e) {
    throw InputError(std::string("--compression: ") + e.what());
  }
  const Interrupt interrupt([] {});
  options.go_on = Interrupt::check;
  Converted converted;
  try {
    converted = convert(arguments.in, arguments.out, options);
  } catch (...) {
    warnings.finish();
    throw;
  }
  warnings.finish();
  std::printf("%s: %zu %s\n", arguments.out.c_str(), converted.count, converted.unit.c_str());
}

}  // namespace

void register_convert(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<ConvertArguments>();
  CLI::App* command =
      app.add_subcommand("convert", "Turn folders and recordings into each other: images and camera, without loss");
  command
      ->add_option("input", arguments->in,
                   "folder of any layout that `run` takes, .bag, .mcap, .db3 or the folder of a rosbag2")
      ->required();
  command->add_option("--out", arguments->out, "FILE.bag, FILE.mcap, or a new folder")->required();
  SourceOptions& source = arguments->options.source;
  command->add_option("--camera", source.camera, "camera file or name, where the input does not tell it");
  command
      ->add_option("--compression", arguments->compression,
                   "of a recording: none, lz4, bz2 (bag) or zstd (mcap); default: zstd in mcap files, else lz4")
      ->check(CLI::IsMember({"none", "lz4", "bz2", "zstd"}));
  command->add_option("--colour-topic", source.colour_topic,
                      "recording to folder: colour images, where there are several");
  command->add_option("--depth-topic", source.depth_topic, "recording to folder: depth images");
  command->add_option("--info-topic", source.info_topic, "recording to folder: camera info");
  command->add_flag("--raw", arguments->options.raw,
                    "folder to recording: colour as pixels instead of the image files as they are");
  command->callback([arguments, &exit_code] {
    run_convert(*arguments);
    exit_code = 0;
  });
}

}  // namespace dkb
