// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/bag_writer.h"

#include <algorithm>

#include "dkb/recordings/bag_format.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr size_t kChunkLimit = 768 << 10;  // [bytes] at which a chunk is closed
constexpr size_t kHeaderRecord = 4096;     // [bytes] set aside for the header, which is filled in at the end
constexpr size_t kMaxMessage = 1U << 30;

uint64_t bag_time(int64_t ns) {
  return static_cast<uint64_t>(ns / 1'000'000'000) | static_cast<uint64_t>(ns % 1'000'000'000) << 32;
}

// A row of `size name=value`.
class Fields {
 public:
  Fields& text(std::string_view name, std::string_view value) {
    bytes_.u32(static_cast<uint32_t>(name.size() + 1 + value.size()));
    bytes_.raw(name), bytes_.raw("="), bytes_.raw(value);
    return *this;
  }
  Fields& u8(std::string_view name, uint8_t value) { return text(name, {reinterpret_cast<const char*>(&value), 1}); }
  Fields& u32(std::string_view name, uint32_t value) {
    ByteWriter number;
    number.u32(value);
    return text(name, number.bytes());
  }
  Fields& u64(std::string_view name, uint64_t value) {
    ByteWriter number;
    number.u64(value);
    return text(name, number.bytes());
  }
  const std::string& bytes() const { return bytes_.bytes(); }

 private:
  ByteWriter bytes_;
};

std::string sized(std::string_view bytes) {
  ByteWriter out;
  out.u32(static_cast<uint32_t>(bytes.size()));
  out.raw(bytes);
  return out.take();
}

std::string bag_record(const Fields& header, std::string_view data) {
  return sized(header.bytes()) + sized(data);
}

}  // namespace

BagWriter::BagWriter(const std::filesystem::path& path, Compression compression)
    : file_(path), compression_(compression) {
  file_.append(bag::kMagic);
  file_.append(bag_header(0));
  end_ = file_.size();
}

std::string BagWriter::bag_header(uint64_t index_at) const {
  const Fields header = Fields()
                            .u8("op", bag::kBagHeader)
                            .u64("index_pos", index_at)
                            .u32("conn_count", static_cast<uint32_t>(connections_.size()))
                            .u32("chunk_count", static_cast<uint32_t>(chunks_.size()));
  return bag_record(header, std::string(kHeaderRecord - 8 - header.bytes().size(), ' '));
}

size_t BagWriter::add_topic(const std::string& name, const std::string& type, bool latched) {
  const MessageDefinition definition = message_definition(type);
  const uint32_t id = static_cast<uint32_t>(connections_.size());
  Fields data;
  data.text("topic", name).text("type", type).text("md5sum", definition.md5sum);
  data.text("message_definition", definition.text);
  if (latched) data.text("latching", "1");
  connections_.push_back(
      bag_record(Fields().u8("op", bag::kConnection).u32("conn", id).text("topic", name), data.bytes()));
  told_.push_back(false);
  return id;
}

void BagWriter::write(size_t topic, int64_t recorded_ns, std::string_view bytes) {
  if (bytes.size() > kMaxMessage) throw OutputError("a message of more than 1 GiB; a bag cannot hold it");
  // ROS takes the time 0 for none.
  recorded_ns = std::clamp<int64_t>(recorded_ns, 1, int64_t{UINT32_MAX} * 1'000'000'000);
  if (!chunk_.empty() && chunk_.size() + bytes.size() > kChunkLimit) flush_chunk();
  if (!told_[topic]) chunk_ += connections_[topic];
  told_[topic] = true;

  const uint32_t connection = static_cast<uint32_t>(topic);
  const uint64_t time = bag_time(recorded_ns);
  if (entries_.empty()) info_.first_ns = info_.last_ns = recorded_ns;
  info_.first_ns = std::min(info_.first_ns, recorded_ns), info_.last_ns = std::max(info_.last_ns, recorded_ns);
  ++info_.counts[connection];
  entries_[connection].push_back({time, static_cast<uint32_t>(chunk_.size())});
  chunk_ += sized(Fields().u8("op", bag::kMessage).u32("conn", connection).u64("time", time).bytes());
  ByteWriter size;
  size.u32(static_cast<uint32_t>(bytes.size()));
  chunk_ += size.bytes();
  chunk_ += bytes;
}

void BagWriter::flush_chunk() {
  if (chunk_.empty()) return;
  const char* name = compression_ == Compression::bz2 ? "bz2" : compression_ == Compression::lz4 ? "lz4" : "none";
  const std::string packed = compression_ == Compression::none ? std::string() : compressed(compression_, chunk_);
  const std::string& stored = compression_ == Compression::none ? chunk_ : packed;
  info_.at = file_.size();
  const Fields header =
      Fields().u8("op", bag::kChunk).text("compression", name).u32("size", static_cast<uint32_t>(chunk_.size()));
  ByteWriter size;
  size.u32(static_cast<uint32_t>(stored.size()));
  file_.append(sized(header.bytes()) + size.bytes());
  file_.append(stored);
  for (const auto& [connection, entries] : entries_) {
    ByteWriter data;
    for (const Entry& entry : entries) data.u64(entry.time), data.u32(entry.offset);
    file_.append(bag_record(Fields()
                                .u8("op", bag::kIndexData)
                                .u32("ver", 1)
                                .u32("conn", connection)
                                .u32("count", static_cast<uint32_t>(entries.size())),
                            data.bytes()));
  }
  chunks_.push_back(info_);
  end_ = file_.size();
  info_ = {};
  entries_.clear();
  chunk_.clear();
}

void BagWriter::close() {
  flush_chunk();
  write_index();
  file_.commit();
}

void BagWriter::salvage() {
  file_.cut(end_);
  try {
    flush_chunk();
  } catch (const OutputError&) {
    chunk_.clear();
  }
  commit_whole_chunks(file_, chunks_, end_, 0, [this] { write_index(); });
}

void BagWriter::write_index() {
  const uint64_t index_at = file_.size();
  for (const std::string& connection : connections_) file_.append(connection);
  for (const ChunkInfo& chunk : chunks_) {
    ByteWriter data;
    for (const auto& [connection, count] : chunk.counts) data.u32(connection), data.u32(count);
    file_.append(bag_record(Fields()
                                .u8("op", bag::kChunkInfo)
                                .u32("ver", 1)
                                .u64("chunk_pos", chunk.at)
                                .u64("start_time", bag_time(chunk.first_ns))
                                .u64("end_time", bag_time(chunk.last_ns))
                                .u32("count", static_cast<uint32_t>(chunk.counts.size())),
                            data.bytes()));
  }
  file_.overwrite(bag::kMagic.size(), bag_header(index_at));
}

}  // namespace dkb
