// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dkb/recordings/output_file.h"
#include "dkb/recordings/recording_writer.h"

namespace dkb {

class McapWriter final : public RecordingWriter {
 public:
  McapWriter(const std::filesystem::path& path, Compression compression);
  size_t add_topic(const std::string& name, const std::string& type, bool latched) override;
  void write(size_t topic, int64_t recorded_ns, std::string_view bytes) override;
  void add_text(const std::string& name, const std::string& text) override;
  void close() override;
  void salvage() override;

 private:
  struct ChunkIndex {
    int64_t first_ns = 0, last_ns = 0;
    uint64_t at = 0, length = 0, index_length = 0, packed = 0, size = 0;
    std::map<uint16_t, uint64_t> index_at, counts;  // of the message index, of messages: by channel
  };
  struct Entry {
    uint64_t time = 0, offset = 0;
  };
  void flush_chunk();
  void write_index();
  std::string statistics() const;

  OutputFile file_;
  const Compression compression_;
  std::vector<std::string> schemas_, channels_, metadata_index_;  // whole records
  std::map<std::string, uint16_t> schema_of_;                     // by type
  std::vector<uint32_t> counts_;                                  // of messages, by channel
  std::string chunk_;
  ChunkIndex index_;
  std::map<uint16_t, std::vector<Entry>> entries_;  // of the chunk, by channel
  std::vector<ChunkIndex> chunks_;
  uint64_t end_ = 0;        // of the last whole chunk
  uint64_t topics_at_ = 0;  // of the last record that tells of a topic; no cut goes before it
};

}  // namespace dkb
