// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "dkb/recordings/chunked_stream.h"

namespace dkb {

// A bag of ROS 1, version 2.0. It is read from front to back; the index at its end, where there is one, tells the
// topics and which chunks need not be read.
class BagStream final : public ChunkedStream {
 public:
  static bool fits(RecordingFile& file);
  explicit BagStream(std::unique_ptr<RecordingFile> file);

 private:
  struct Record;
  enum class Found { record, cut, broken };
  Found record_at(uint64_t at, Record* record);
  void read_index(uint64_t at);
  void add_connection(std::string_view header, std::string_view data);
  void add_chunk_info(std::string_view header, std::string_view data);
  bool next_chunk() override;
  void open_chunk(const Record& record);
  std::optional<RecordedMessage> next_in_chunk() override;
};

}  // namespace dkb
