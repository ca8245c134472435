// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/bag_stream.h"

#include "dkb/recordings/bag_format.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr uint32_t kMaxHeader = 1 << 16, kMaxConnection = 1 << 22;  // [bytes] beyond which a record is taken for broken

template <class T>
T little(std::string_view bytes) {
  T value = 0;
  for (size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | static_cast<T>(static_cast<T>(static_cast<uint8_t>(bytes[i])) << (8 * i)));
  return value;
}

// A header is a row of `size name=value`. The value of the first field of this name.
std::optional<std::string_view> field(std::string_view header, std::string_view name) {
  while (header.size() >= 4) {
    const uint32_t size = little<uint32_t>(header);
    header.remove_prefix(4);
    if (size > header.size()) return std::nullopt;
    const std::string_view text = header.substr(0, size);
    if (text.size() > name.size() && text[name.size()] == '=' && text.substr(0, name.size()) == name)
      return text.substr(name.size() + 1);
    header.remove_prefix(size);
  }
  return std::nullopt;
}

template <class T>
std::optional<T> number(std::string_view header, std::string_view name) {
  const std::optional<std::string_view> value = field(header, name);
  if (!value || value->size() != sizeof(T)) return std::nullopt;
  return little<T>(*value);
}

}  // namespace

// A record in the file. Its data may reach beyond the file's end.
struct BagStream::Record {
  std::string header;
  uint8_t op = 0;
  uint64_t data_at = 0;
  uint32_t data_size = 0;
  uint64_t end() const { return data_at + data_size; }
};

bool BagStream::fits(RecordingFile& file) {
  constexpr std::string_view kAnyBag = "#ROSBAG V";
  const std::string begin(file.peek(0, bag::kMagic.size()));
  if (begin.rfind(kAnyBag, 0) != 0) return false;
  if (begin != bag::kMagic)
    throw InputError(file.name() + ": is a bag of version " + begin.substr(kAnyBag.size(), 3) +
                     "; version 2.0 is read, and `rosbag fix` writes it");
  return true;
}

BagStream::BagStream(std::unique_ptr<RecordingFile> file) : ChunkedStream(std::move(file)) {
  Record header;
  if (record_at(bag::kMagic.size(), &header) != Found::record || header.op != bag::kBagHeader)
    throw InputError(file_->name() + ": is a bag without its header; it cannot be read");
  if (const auto encryptor = field(header.header, "encryptor"); encryptor && !encryptor->empty())
    throw InputError(file_->name() + ": is encrypted; `rosbag decrypt` makes it readable");
  at_ = start_ = header.end();
  const uint64_t index = number<uint64_t>(header.header, "index_pos").value_or(0);
  if (index >= start_ && index < file_->size()) {
    end_ = index;
    read_index(index);
  } else {
    warn(
        "has no index: it is cut off, or its recorder was stopped. It is read up to where it ends; `rosbag reindex` "
        "repairs it");
    told_cut_ = true;
  }
}

BagStream::Found BagStream::record_at(uint64_t at, Record* record) {
  const std::string_view start = file_->peek(at, 4);
  if (start.size() < 4) return Found::cut;
  const uint32_t header_size = little<uint32_t>(start);
  if (header_size > kMaxHeader) return Found::broken;
  const std::string_view whole = file_->peek(at, size_t{header_size} + 8);
  if (whole.size() < size_t{header_size} + 8) return Found::cut;
  record->header = whole.substr(4, header_size);
  record->data_size = little<uint32_t>(whole.substr(4 + header_size));
  record->data_at = at + 8 + header_size;
  const std::optional<uint8_t> op = number<uint8_t>(record->header, "op");
  if (!op || *op < bag::kMessage || *op > bag::kConnection) return Found::broken;
  record->op = *op;
  return Found::record;
}

void BagStream::read_index(uint64_t at) {
  Record record;
  while (at < file_->size()) {
    const Found found = record_at(at, &record);
    const bool small = found == Found::record && record.data_size <= kMaxConnection;
    const std::string_view data = small ? file_->peek(record.data_at, record.data_size) : std::string_view();
    const bool cut = found == Found::cut || (small && data.size() < record.data_size);
    if (!small || cut) {
      told_cut_ = cut;
      warn((cut ? "is cut off in its index" : "its index is broken at byte " + std::to_string(at)) +
           "; it is read from front to back");
      topics_.forget_counts();
      chunks_.clear();  // the rest is not known, so none is passed over
      return;
    }
    if (record.op == bag::kConnection) add_connection(record.header, data);
    if (record.op == bag::kChunkInfo) add_chunk_info(record.header, data);
    at = record.end();
  }
  topics_.count_rest();
}

void BagStream::add_connection(std::string_view header, std::string_view data) {
  // Inside a chunk nothing else bounds them.
  if (header.size() > kMaxHeader || data.size() > kMaxConnection)
    return warn("the chunk at byte " + std::to_string(chunk_at_) +
                " holds a connection that is too large; it is left out");
  const std::optional<uint32_t> id = number<uint32_t>(header, "conn");
  const std::optional<std::string_view> topic = field(header, "topic"), type = field(data, "type");
  if (!id || !topic || !type || topic_of_.count(*id)) return;
  if (topic_of_.size() >= RecordedTopics::kMost) return;
  if (topic->size() > RecordedTopics::kLongestName || type->size() > RecordedTopics::kLongestName)
    warn("connection " + std::to_string(*id) + " has a name that is too long; it is left out");
  if (const auto added = topics_.add(std::string(*topic), std::string(*type), MessageEncoding::ros1))
    topic_of_[*id] = *added;
}

void BagStream::add_chunk_info(std::string_view header, std::string_view data) {
  const std::optional<uint64_t> at = number<uint64_t>(header, "chunk_pos");
  if (!at) return;
  std::vector<uint32_t>& connections = chunks_[*at];
  for (; data.size() >= 8; data.remove_prefix(8)) {
    connections.push_back(little<uint32_t>(data));
    if (const auto topic = topic_of_.find(connections.back()); topic != topic_of_.end())
      topics_.add_count(*topic->second, little<uint32_t>(data.substr(4)));
  }
}

bool BagStream::next_chunk() {
  Record record;
  while (at_ < end_) {
    const uint64_t at = at_;
    const Found found = record_at(at, &record);
    if (found == Found::cut) {
      tell_cut(at);
      break;
    }
    if (found == Found::broken) {
      const bool goes_on = skip_to_chunk_after(at);
      warn("is broken at byte " + std::to_string(at) +
           (goes_on ? "; it is read on from the next chunk" : "; what follows is not read"));
      if (!goes_on) break;
      continue;
    }
    at_ = record.end();
    if (record.op == bag::kConnection && record.data_size <= kMaxConnection)
      add_connection(record.header, file_->peek(record.data_at, record.data_size));
    if (record.op != bag::kChunk || !chunk_wanted(at)) continue;
    chunk_at_ = at;
    open_chunk(record);
    if (!rest_.empty()) return true;
  }
  at_ = end_;
  return false;
}

void BagStream::open_chunk(const Record& record) {
  const uint32_t size = number<uint32_t>(record.header, "size").value_or(record.data_size);
  const std::string broken =
      load(field(record.header, "compression").value_or("none"), record.data_at, record.data_size, size);
  if (!broken.empty())
    warn("the chunk at byte " + std::to_string(chunk_at_) + " is broken (" + broken + ") and left out");
}

std::optional<RecordedMessage> BagStream::next_in_chunk() {
  // A part of the chunk of this many bytes; nothing at its end.
  const auto take = [&](size_t size) -> std::optional<std::string_view> {
    if (size > rest_.size()) return std::nullopt;
    const std::string_view part = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return part;
  };
  const auto sized = [&]() -> std::optional<std::string_view> {
    const auto size = take(4);
    return size ? take(little<uint32_t>(*size)) : std::nullopt;
  };
  while (!rest_.empty()) {
    const auto header = sized();
    const auto data = header ? sized() : std::nullopt;
    const std::optional<uint8_t> op = data ? number<uint8_t>(*header, "op") : std::nullopt;
    if (!op) {
      if (!cut_in_chunk_)
        warn("the chunk at byte " + std::to_string(chunk_at_) + " is broken; the rest of it is left out");
      rest_ = {};
      break;
    }
    if (*op == bag::kConnection) add_connection(*header, *data);
    if (*op != bag::kMessage) continue;
    const std::optional<uint32_t> connection = number<uint32_t>(*header, "conn");
    const std::optional<uint64_t> time = number<uint64_t>(*header, "time");
    const std::optional<size_t> topic = connection ? wanted(*connection) : std::nullopt;
    if (!time || !topic) continue;
    const int64_t ns = static_cast<int64_t>(*time & 0xFFFFFFFF) * 1'000'000'000 + static_cast<int64_t>(*time >> 32);
    return RecordedMessage{*topic, ns, *data};
  }
  return std::nullopt;
}

}  // namespace dkb
