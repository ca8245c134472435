// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_writer.h"

#include "dkb/recordings/bag_writer.h"
#include "dkb/recordings/mcap_writer.h"
#include "dkb/util/errors.h"

namespace dkb {

bool is_recording_name(const std::filesystem::path& path) {
  return path.extension() == ".bag" || path.extension() == ".mcap";
}

std::unique_ptr<RecordingWriter> write_recording(const std::filesystem::path& path, Compression compression) {
  if (path.extension() == ".bag") {
    if (compression == Compression::zstd) throw InvalidOption("--compression", "zstd", "none, bz2 or lz4 in a bag");
    return std::make_unique<BagWriter>(path, compression);
  }
  if (path.extension() == ".mcap") {
    if (compression == Compression::bz2)
      throw InvalidOption("--compression", "bz2", "none, lz4 or zstd in an mcap file");
    return std::make_unique<McapWriter>(path, compression);
  }
  throw InputError(path.string() + ": a recording is written as FILE.bag or FILE.mcap");
}

}  // namespace dkb
