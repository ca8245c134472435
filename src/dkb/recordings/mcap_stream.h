// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>

#include "dkb/map/byte_stream.h"
#include "dkb/recordings/chunked_stream.h"

namespace dkb {

// An mcap file. It is read from front to back; the summary at its end, where there is one, tells the topics and which
// chunks need not be read. Checksums of chunks and of the summary are looked at; that of the whole file is not, since
// it needs every byte of it.
class McapStream final : public ChunkedStream {
 public:
  static bool fits(RecordingFile& file);
  explicit McapStream(std::unique_ptr<RecordingFile> file);

  std::map<std::string, std::string> metadata() const override { return texts_; }

 private:
  struct Record;
  std::optional<Record> record_at(uint64_t at);
  bool read_summary();
  bool summary_sound(uint64_t from, uint64_t to, uint32_t crc);
  void take_small(const Record& record);
  void take(uint8_t op, std::string_view bytes);
  void add_metadata(ByteReader in);
  void add_chunk_index(ByteReader in);
  bool next_chunk() override;
  void open_chunk(const Record& record);
  std::optional<RecordedMessage> next_in_chunk() override;
  void warn_of_record(uint64_t at, const std::string& what);
  void warn_of_name(const std::string& kind, uint16_t id);
  void tell_foreign();

  std::map<uint16_t, std::string> schemas_;  // name by id
  std::set<std::string> foreign_;            // encodings of others
  std::map<std::string, std::string> texts_;
  size_t texts_size_ = 0;
  uint64_t metadata_read_ = 0;  // [bytes] by the index
  bool all_counted_ = false;    // statistics count every message
  bool told_foreign_ = false;
};

}  // namespace dkb
