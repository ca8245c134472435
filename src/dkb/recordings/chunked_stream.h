// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>

#include "dkb/recordings/recorded_topics.h"
#include "dkb/recordings/recording_file.h"

namespace dkb {

// A file of chunks of messages. It is read from front to back, one chunk at a time; what an index tells of the chunks
// says which need not be read. Messages belong to channels, which each kind of file tells in its own way.
class ChunkedStream : public MessageStream {
 public:
  const std::vector<RecordedTopic>& topics() const override { return topics_.all(); }
  void select(const std::vector<std::string>& names) override { topics_.select(names); }
  std::optional<RecordedMessage> next() override;
  void rewind() override { at_ = start_, rest_ = {}; }
  std::vector<std::string> take_warnings() override { return warnings_.take(); }

 protected:
  explicit ChunkedStream(std::unique_ptr<RecordingFile> file) : file_(std::move(file)), end_(file_->size()) {}

  // Opens the next chunk that may hold something wanted. False at the end.
  virtual bool next_chunk() = 0;
  virtual std::optional<RecordedMessage> next_in_chunk() = 0;

  // The topic of a channel, when it is wanted.
  std::optional<size_t> wanted(uint32_t channel) const;
  bool chunk_wanted(uint64_t at) const;
  // Brings the chunk at chunk_at_ into rest_. Says why it is broken; empty when it is not.
  std::string load(std::string_view compression, uint64_t at, uint64_t packed, uint64_t size);
  // Goes from something broken to the next chunk of the index; false when there is none.
  bool skip_to_chunk_after(uint64_t at);
  void warn(const std::string& what) { warnings_.add(file_->name() + ": " + what); }
  void tell_cut(uint64_t at);

  std::unique_ptr<RecordingFile> file_;
  RecordedTopics topics_;
  std::map<uint32_t, std::optional<size_t>> topic_of_;  // by channel; nothing for those that cannot be read
  std::map<uint64_t, std::vector<uint32_t>> chunks_;    // channels of each in the index, by place; empty = not known
  uint64_t start_ = 0, end_ = 0;                        // of the records in front of the index
  bool told_cut_ = false;

  uint64_t at_ = 0;        // the next record in the file
  uint64_t chunk_at_ = 0;  // the chunk, or the message outside of one, that is open
  std::string_view rest_;  // of the open chunk
  bool cut_in_chunk_ = false;

 private:
  RecordingWarnings warnings_;
  ChunkBuffer chunk_;
};

}  // namespace dkb
