// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "dkb/recordings/recording_file.h"

namespace dkb {

// Writes a recording with its index: a bag of ROS 1 (version 2.0) or an mcap file, with messages in the ROS 1 encoding
// (encode() of ros_messages.h) in both. Throws OutputError.
class RecordingWriter {
 public:
  // Without close() nothing is left behind, and a file of this name stays what it was.
  virtual ~RecordingWriter() = default;
  // `type` is one of message_definition()'s. `latched`: a player hands the last message to those that come later.
  virtual size_t add_topic(const std::string& name, const std::string& type, bool latched = false) = 0;
  // In the order in which they are to be read; that is by time in a recording that others read.
  virtual void write(size_t topic, int64_t recorded_ns, std::string_view bytes) = 0;
  // A text beside the messages, where the format has such: in an mcap file a metadata record.
  virtual void add_text(const std::string& name, const std::string& text) = 0;
  // The file is there, whole, when this returns.
  virtual void close() = 0;
  // In the place of close(), after write() or close() has thrown: the file holds the whole chunks for which, and for
  // whose index, there is room. Throws when there are none.
  virtual void salvage() = 0;
};

// Whether its ending is .bag or .mcap.
bool is_recording_name(const std::filesystem::path& path);

// By the ending of `path`: .bag or .mcap. Bags take none, bz2 and lz4; mcap files none, lz4 and zstd.
std::unique_ptr<RecordingWriter> write_recording(const std::filesystem::path& path,
                                                 Compression compression = Compression::none);

}  // namespace dkb
