// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>

#include "dkb/recordings/recorded_topics.h"
#include "dkb/recordings/recording_file.h"

namespace dkb {

// A bag of ROS 1, version 2.0. It is read from front to back; the index at its end, where there is one, tells the
// topics and which chunks need not be read.
class BagStream final : public MessageStream {
 public:
  static bool fits(RecordingFile& file);
  explicit BagStream(std::unique_ptr<RecordingFile> file);

  const std::vector<RecordedTopic>& topics() const override { return topics_.all(); }
  void select(const std::vector<std::string>& names) override { topics_.select(names); }
  std::optional<RecordedMessage> next() override;
  void rewind() override;
  std::vector<std::string> take_warnings() override { return warnings_.take(); }

 private:
  struct Record;
  enum class Found { record, cut, broken };
  Found record_at(uint64_t at, Record* record);
  void read_index(uint64_t at);
  void add_connection(std::string_view header, std::string_view data);
  void add_chunk_info(std::string_view header, std::string_view data);
  bool chunk_wanted(uint64_t at) const;
  bool next_chunk();
  void open_chunk(const Record& record);
  std::optional<RecordedMessage> next_in_chunk();
  void tell_cut(uint64_t at);

  std::unique_ptr<RecordingFile> file_;
  RecordedTopics topics_;
  RecordingWarnings warnings_;
  std::map<uint32_t, size_t> topic_of_;               // by connection
  std::map<uint64_t, std::vector<uint32_t>> chunks_;  // connections in each chunk of the index, by its place
  uint64_t start_ = 0, end_ = 0;                      // of the records in front of the index
  bool told_cut_ = false;

  uint64_t at_ = 0;        // the next record in the file
  uint64_t chunk_at_ = 0;  // the chunk that is open
  ChunkBuffer chunk_;
  std::string_view rest_;  // of the open chunk
  bool cut_in_chunk_ = false;
};

}  // namespace dkb
