// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "dkb/map/byte_stream.h"
#include "dkb/recordings/output_file.h"
#include "dkb/recordings/recording_writer.h"

namespace dkb {

class BagWriter final : public RecordingWriter {
 public:
  BagWriter(const std::filesystem::path& path, Compression compression);
  size_t add_topic(const std::string& name, const std::string& type, bool latched) override;
  void write(size_t topic, int64_t recorded_ns, std::string_view bytes) override;
  void add_text(const std::string&, const std::string&) override {}  // bags have no place for it
  void close() override;
  void salvage() override;

 private:
  struct Entry {
    uint64_t time = 0;    // as bags store it: seconds low, nanoseconds high
    uint32_t offset = 0;  // in the chunk
  };
  struct ChunkInfo {
    uint64_t at = 0;
    int64_t first_ns = 0, last_ns = 0;
    std::map<uint32_t, uint32_t> counts;  // by connection
  };
  std::string bag_header(uint64_t index_at) const;
  void flush_chunk();
  void write_index();

  OutputFile file_;
  const Compression compression_;
  std::vector<std::string> connections_;  // whole records
  std::vector<bool> told_;                // the connection's record is in a chunk
  std::string chunk_;
  ChunkInfo info_;
  std::map<uint32_t, std::vector<Entry>> entries_;  // of the chunk, by connection
  std::vector<ChunkInfo> chunks_;
  uint64_t end_ = 0;  // of the last whole chunk
};

}  // namespace dkb
