// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>

#include "dkb/map/byte_stream.h"
#include "dkb/recordings/recorded_topics.h"
#include "dkb/recordings/recording_file.h"

namespace dkb {

// An mcap file. It is read from front to back; the summary at its end, where there is one, tells the topics and which
// chunks need not be read. Checksums of chunks and of the summary are looked at; that of the whole file is not, since
// it needs every byte of it.
class McapStream final : public MessageStream {
 public:
  static bool fits(RecordingFile& file);
  explicit McapStream(std::unique_ptr<RecordingFile> file);

  const std::vector<RecordedTopic>& topics() const override { return topics_.all(); }
  void select(const std::vector<std::string>& names) override { topics_.select(names); }
  std::optional<RecordedMessage> next() override;
  void rewind() override;
  std::map<std::string, std::string> metadata() const override { return texts_; }
  std::vector<std::string> take_warnings() override { return warnings_.take(); }

 private:
  struct Record;
  std::optional<Record> record_at(uint64_t at);
  bool read_summary();
  bool summary_sound(uint64_t from, uint64_t to, uint32_t crc);
  void take_small(const Record& record);
  void take(uint8_t op, std::string_view bytes);
  void add_metadata(ByteReader in);
  void add_chunk_index(ByteReader in);
  bool chunk_wanted(uint64_t at) const;
  bool next_record();
  void open_chunk(const Record& record);
  std::optional<RecordedMessage> next_in_chunk();
  bool wanted(uint16_t channel, size_t* topic) const;
  void warn_of_record(uint64_t at, const std::string& what);
  void warn_of_name(const std::string& kind, uint16_t id);
  void tell_cut(uint64_t at);
  void tell_foreign();

  std::unique_ptr<RecordingFile> file_;
  RecordedTopics topics_;
  RecordingWarnings warnings_;
  std::map<uint16_t, std::string> schemas_;             // name by id
  std::map<uint16_t, std::optional<size_t>> topic_of_;  // by channel; nothing for encodings of others
  std::set<std::string> foreign_;                       // those encodings
  std::map<uint64_t, std::vector<uint16_t>>
      chunks_;  // channels in each chunk of the index, by its place; empty = not known
  std::map<std::string, std::string> texts_;
  size_t texts_size_ = 0;
  uint64_t metadata_read_ = 0;    // [bytes] by the index
  uint64_t start_ = 0, end_ = 0;  // of the data section
  bool all_counted_ = false;      // statistics count every message
  bool told_cut_ = false, told_foreign_ = false;

  uint64_t at_ = 0;        // the next record in the file
  uint64_t chunk_at_ = 0;  // the chunk, or the message outside of one, that is open
  ChunkBuffer chunk_;
  std::string_view rest_;  // of the open chunk
  bool cut_in_chunk_ = false;
};

}  // namespace dkb
