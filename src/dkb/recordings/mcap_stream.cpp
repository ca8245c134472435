// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/mcap_stream.h"

#include <zlib.h>

#include <algorithm>

#include "dkb/recordings/mcap_format.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr uint64_t kMaxSmall = 1 << 24;        // [bytes] of a record that is no chunk and no message
constexpr size_t kMaxTexts = size_t{1} << 26;  // [bytes] of all metadata

uint16_t u16(ByteReader& in) {
  const uint8_t low = in.u8();
  return static_cast<uint16_t>(low | in.u8() << 8);
}

std::string_view text(ByteReader& in) {
  return in.raw(in.u32());
}

}  // namespace

// A record in the file. Its content may reach beyond the file's end.
struct McapStream::Record {
  uint8_t op = 0;
  uint64_t at = 0, size = 0;  // of the content
  uint64_t end() const { return at + size; }
};

bool McapStream::fits(RecordingFile& file) {
  const std::string_view begin = file.peek(0, mcap::kMagic.size());
  if (begin.substr(0, 5) != mcap::kMagic.substr(0, 5)) return false;
  if (begin != mcap::kMagic)
    throw InputError(file.name() + ": is an mcap file of another version than 0, which is read");
  return true;
}

McapStream::McapStream(std::unique_ptr<RecordingFile> file) : ChunkedStream(std::move(file)) {
  at_ = start_ = mcap::kMagic.size();
  if (!read_summary()) {
    schemas_.clear(), chunks_.clear();
    // What stands before the first messages.
    for (uint64_t at = start_; at < end_;) {
      const std::optional<Record> record = record_at(at);
      if (!record || record->op == mcap::kChunk || record->op == mcap::kMessage || record->op == mcap::kDataEnd) break;
      take_small(*record);
      at = record->end();
    }
  }
}

std::optional<McapStream::Record> McapStream::record_at(uint64_t at) {
  const std::string_view start = file_->peek(at, mcap::kRecordStart);
  if (start.size() < mcap::kRecordStart) return std::nullopt;
  ByteReader in(start, "");
  Record record;
  record.op = in.u8();
  record.size = in.u64();
  record.at = at + mcap::kRecordStart;
  if (record.size > UINT64_MAX / 2) return std::nullopt;
  return record;
}

// False when there is none that can be used.
bool McapStream::read_summary() {
  const auto read_through = [&](const std::string& why) {
    warn(why);
    return false;
  };
  const std::string cut =
      "has no end: it is cut off, or its recorder was stopped. It is read up to where it ends; "
      "`mcap recover` repairs it";
  constexpr uint64_t kTail = mcap::kRecordStart + mcap::kFooterSize + mcap::kMagic.size();
  if (file_->size() < mcap::kMagic.size() + kTail) return told_cut_ = true, read_through(cut);
  const uint64_t footer_at = file_->size() - kTail;
  const std::string tail(file_->peek(footer_at, kTail));
  ByteReader in(tail, "footer");
  const bool footer = in.u8() == mcap::kFooter && in.u64() == mcap::kFooterSize;
  if (!footer || std::string_view(tail).substr(tail.size() - mcap::kMagic.size()) != mcap::kMagic)
    return told_cut_ = true, read_through(cut);
  const uint64_t summary = in.u64();
  in.u64();
  const uint32_t crc = in.u32();
  end_ = footer_at;
  if (summary == 0) return false;
  const std::string broken = "its summary is broken; it is read from front to back";
  if (summary < start_ || summary > footer_at) return read_through(broken);
  if (crc != 0 && !summary_sound(summary, footer_at + mcap::kRecordStart + 16, crc)) return read_through(broken);
  for (uint64_t at = summary; at < footer_at;) {
    const std::optional<Record> record = record_at(at);
    if (!record || record->op == 0 || record->end() > footer_at) return read_through(broken);
    take_small(*record);
    at = record->end();
  }
  if (all_counted_) topics_.count_rest();
  end_ = summary;
  tell_foreign();
  return true;
}

bool McapStream::summary_sound(uint64_t from, uint64_t to, uint32_t crc) {
  uLong sum = 0;
  while (from < to) {
    const std::string_view piece = file_->peek(from, static_cast<size_t>(std::min<uint64_t>(to - from, 16384)));
    if (piece.empty()) return false;
    sum = crc32(sum, reinterpret_cast<const Bytef*>(piece.data()), static_cast<uInt>(piece.size()));
    from += piece.size();
  }
  return sum == crc;
}

// A record that is neither a chunk nor a message.
void McapStream::take_small(const Record& record) {
  const bool known = record.op == mcap::kSchema || record.op == mcap::kChannel || record.op == mcap::kMetadata ||
                     record.op == mcap::kMetadataIndex || record.op == mcap::kChunkIndex ||
                     record.op == mcap::kStatistics;
  if (!known || record.end() > file_->size()) return;
  if (record.size > kMaxSmall) return warn_of_record(record.at, "is too large and left out");
  const std::string bytes(file_->peek(record.at, static_cast<size_t>(record.size)));
  try {
    take(record.op, bytes);
  } catch (const InputError&) {
    warn_of_record(record.at, "is broken and left out");
  }
}

void McapStream::take(uint8_t op, std::string_view bytes) {
  ByteReader in(bytes, "record");
  if (op == mcap::kSchema) {
    const uint16_t id = u16(in);
    const std::string_view name = text(in);
    if (name.size() > RecordedTopics::kLongestName) return warn_of_name("schema", id);
    schemas_[id] = name;
  } else if (op == mcap::kChannel) {
    const uint16_t id = u16(in), schema = u16(in);
    const std::string_view topic = text(in), encoding = text(in);
    if (topic_of_.count(id)) return;
    if (topic.size() > RecordedTopics::kLongestName) warn_of_name("channel", id);
    if (encoding == "ros1" || encoding == "cdr") {
      const auto type = schemas_.find(schema);
      topic_of_[id] = topics_.add(std::string(topic), type == schemas_.end() ? "" : type->second,
                                  encoding == "ros1" ? MessageEncoding::ros1 : MessageEncoding::cdr);
    } else {
      topic_of_[id] = std::nullopt;
      if (foreign_.size() < 5) foreign_.emplace(encoding.empty() ? "no name" : encoding.substr(0, 40));
    }
  } else if (op == mcap::kMetadata) {
    add_metadata(in);
  } else if (op == mcap::kMetadataIndex) {
    const uint64_t at = in.u64();
    const std::optional<Record> record = record_at(at);
    // The index may name one record any number of times.
    if (!record || record->op != mcap::kMetadata || record->size > kMaxTexts - metadata_read_) return;
    metadata_read_ += record->size;
    take_small(*record);
  } else if (op == mcap::kChunkIndex) {
    add_chunk_index(in);
  } else if (op == mcap::kStatistics) {
    const uint64_t messages = in.u64();
    uint64_t counted = 0;
    in.raw(2 + 4 + 4 + 4 + 4 + 8 + 8);
    for (ByteReader counts(text(in), "counts"); counts.left() > 0;) {
      const uint16_t channel = u16(counts);
      const uint64_t count = counts.u64();
      const auto topic = topic_of_.find(channel);
      if (topic != topic_of_.end() && topic->second && count < UINT32_MAX)
        topics_.add_count(*topic->second, static_cast<int64_t>(count));
      counted += count;
    }
    all_counted_ = counted == messages;
  }
}

// A record of one text goes by its name, one of several by NAME/KEY.
void McapStream::add_metadata(ByteReader in) {
  const std::string name(text(in));
  std::map<std::string, std::string> pairs;
  for (ByteReader map(text(in), "metadata"); map.left() > 0;) {
    const std::string key(text(map));
    pairs[key] = text(map);
  }
  for (const auto& [key, value] : pairs) {
    if (texts_size_ + name.size() + key.size() + value.size() > kMaxTexts) return;
    texts_size_ += name.size() + key.size() + value.size();
    texts_[pairs.size() == 1 ? name : name + "/" + key] = value;
  }
}

void McapStream::add_chunk_index(ByteReader in) {
  in.raw(8 + 8);
  std::vector<uint32_t>& channels = chunks_[in.u64()];
  in.u64();
  for (ByteReader offsets(text(in), "offsets"); offsets.left() > 0; offsets.u64()) channels.push_back(u16(offsets));
}

void McapStream::warn_of_record(uint64_t at, const std::string& what) {
  warn("the record at byte " + std::to_string(at - mcap::kRecordStart) + " " + what);
}

void McapStream::warn_of_name(const std::string& kind, uint16_t id) {
  warn(kind + " " + std::to_string(id) + " has a name that is too long; it is left out");
}

void McapStream::tell_foreign() {
  if (told_foreign_ || foreign_.empty() || !topics_.all().empty()) return;
  std::string names;
  for (const std::string& name : foreign_) names += (names.empty() ? "" : ", ") + name;
  warn("its messages are encoded as " + names + "; ros1 and cdr are read");
  told_foreign_ = true;
}

// A message outside of chunks is read as a chunk that holds it alone.
bool McapStream::next_chunk() {
  while (at_ < end_) {
    const uint64_t at = at_;
    const std::optional<Record> record = record_at(at);
    if (record && record->op == 0) {
      const bool goes_on = skip_to_chunk_after(at);
      warn_of_record(record->at, goes_on ? "is broken; what follows is read from the next chunk"
                                         : "is broken; what follows is not read");
      if (!goes_on) break;
      continue;
    }
    if (!record || (record->end() > file_->size() && record->op != mcap::kChunk)) {
      tell_cut(at);
      break;
    }
    at_ = record->end();
    if (record->op == mcap::kDataEnd || record->op == mcap::kFooter) break;
    chunk_at_ = at;
    if (record->op == mcap::kChunk) {
      if (chunk_wanted(at)) open_chunk(*record);
    } else if (record->op == mcap::kMessage) {
      const std::string_view id = file_->peek(record->at, 2);
      ByteReader in(id, "channel");
      if (id.size() < 2 || !wanted(u16(in))) continue;
      const std::string broken = load("", at, mcap::kRecordStart + record->size, 0);
      if (!broken.empty()) warn_of_record(record->at, "is broken (" + broken + ") and left out");
    } else {
      take_small(*record);
    }
    if (!rest_.empty()) return true;
  }
  at_ = end_;
  tell_foreign();
  return false;
}

void McapStream::open_chunk(const Record& record) {
  constexpr size_t kMaxStart = 200;  // [bytes] before the chunk's records: numbers and a name
  const std::string start(file_->peek(record.at, static_cast<size_t>(std::min<uint64_t>(record.size, kMaxStart))));
  ByteReader in(start, "chunk");
  uint64_t size = 0, packed = 0;
  uint32_t crc = 0;
  std::string compression;
  try {
    in.raw(16);
    size = in.u64();
    crc = in.u32();
    compression = text(in);
    packed = in.u64();
  } catch (const InputError&) {
    if (record.end() > file_->size()) return tell_cut(chunk_at_);
    return warn_of_record(record.at, "is broken and left out");
  }
  const uint64_t taken = 16 + 8 + 4 + 4 + compression.size() + 8;
  if (packed > record.size - taken) return warn_of_record(record.at, "is broken and left out");
  std::string broken = load(compression, record.at + taken, packed, size);
  if (broken.empty() && !cut_in_chunk_ && crc != 0 &&
      crc32_z(0, reinterpret_cast<const Bytef*>(rest_.data()), rest_.size()) != crc)
    broken = "its checksum is another", rest_ = {};
  if (!broken.empty()) warn_of_record(record.at, "is broken (" + broken + ") and left out");
}

std::optional<RecordedMessage> McapStream::next_in_chunk() {
  try {
    while (!rest_.empty()) {
      ByteReader in(rest_, "record");
      const uint8_t op = in.u8();
      const uint64_t size = in.u64();
      if (size > rest_.size() - mcap::kRecordStart) throw InputError("");
      const std::string_view content = rest_.substr(mcap::kRecordStart, static_cast<size_t>(size));
      rest_.remove_prefix(mcap::kRecordStart + content.size());
      if (op == mcap::kSchema || op == mcap::kChannel) {
        if (size > kMaxSmall)
          warn_of_record(chunk_at_ + mcap::kRecordStart, "holds a record that is too large and left out");
        else
          take(op, content);
      }
      if (op != mcap::kMessage) continue;
      ByteReader message(content, "message");
      const std::optional<size_t> topic = wanted(u16(message));
      message.u32();
      const uint64_t logged = message.u64();
      message.u64();
      if (topic) return RecordedMessage{*topic, static_cast<int64_t>(logged), content.substr(mcap::kMessageStart)};
    }
  } catch (const InputError&) {
    if (!cut_in_chunk_) warn_of_record(chunk_at_ + mcap::kRecordStart, "is broken; the rest of it is left out");
    rest_ = {};
  }
  return std::nullopt;
}

}  // namespace dkb
