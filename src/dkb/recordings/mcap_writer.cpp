// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/mcap_writer.h"

#include <zlib.h>

#include <algorithm>

#include "dkb/map/byte_stream.h"
#include "dkb/recordings/mcap_format.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb_slam/version.h"

namespace dkb {
namespace {

constexpr size_t kChunkSize = 1 << 20;  // [bytes] at which a chunk is closed

uint32_t crc_of(std::string_view bytes) {
  return static_cast<uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

void u16(ByteWriter& out, uint16_t v) {
  out.u8(static_cast<uint8_t>(v)), out.u8(static_cast<uint8_t>(v >> 8));
}

void text(ByteWriter& out, std::string_view v) {
  out.u32(static_cast<uint32_t>(v.size()));
  out.raw(v);
}

std::string record_start(mcap::Op op, size_t size) {
  ByteWriter out;
  out.u8(op);
  out.u64(size);
  return out.take();
}

std::string record(mcap::Op op, const ByteWriter& content) {
  return record_start(op, content.bytes().size()) + content.bytes();
}

const char* name_of(Compression compression) {
  return compression == Compression::lz4 ? "lz4" : compression == Compression::zstd ? "zstd" : "";
}

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& path, Compression compression)
    : file_(path), compression_(compression) {
  file_.append(mcap::kMagic);
  ByteWriter header;
  text(header, "ros1");
  text(header, "dkb-slam " DKB_SLAM_VERSION);
  file_.append(record(mcap::kHeader, header));
}

size_t McapWriter::add_topic(const std::string& name, const std::string& type, bool latched) {
  const auto [schema, is_new] = schema_of_.emplace(type, static_cast<uint16_t>(schema_of_.size() + 1));
  const MessageDefinition definition = message_definition(type);
  if (is_new) {
    ByteWriter out;
    u16(out, schema->second);
    text(out, type), text(out, "ros1msg"), text(out, definition.text);
    file_.append(schemas_.emplace_back(record(mcap::kSchema, out)));
  }
  ByteWriter pairs;
  if (latched) text(pairs, "latching"), text(pairs, "1");
  text(pairs, "md5sum"), text(pairs, definition.md5sum);
  text(pairs, "topic"), text(pairs, name);
  ByteWriter out;
  u16(out, static_cast<uint16_t>(channels_.size())), u16(out, schema->second);
  text(out, name), text(out, "ros1"), text(out, pairs.bytes());
  topics_at_ = file_.size();
  file_.append(channels_.emplace_back(record(mcap::kChannel, out)));
  counts_.push_back(0);
  return channels_.size() - 1;
}

void McapWriter::add_text(const std::string& name, const std::string& content) {
  ByteWriter pairs;
  text(pairs, name), text(pairs, content);
  ByteWriter out;
  text(out, name), text(out, pairs.bytes());
  const std::string bytes = record(mcap::kMetadata, out);
  ByteWriter index;
  index.u64(file_.size()), index.u64(bytes.size());
  text(index, name);
  metadata_index_.push_back(record(mcap::kMetadataIndex, index));
  file_.append(bytes);
}

void McapWriter::write(size_t topic, int64_t recorded_ns, std::string_view bytes) {
  if (!chunk_.empty() && chunk_.size() + bytes.size() > kChunkSize) flush_chunk();
  const uint16_t channel = static_cast<uint16_t>(topic);
  const uint64_t time = static_cast<uint64_t>(recorded_ns);
  if (entries_.empty()) index_.first_ns = index_.last_ns = recorded_ns;
  index_.first_ns = std::min(index_.first_ns, recorded_ns), index_.last_ns = std::max(index_.last_ns, recorded_ns);
  entries_[channel].push_back({time, chunk_.size()});
  ByteWriter start;
  u16(start, channel);
  start.u32(counts_[topic]++);
  start.u64(time), start.u64(time);
  chunk_ += record_start(mcap::kMessage, mcap::kMessageStart + bytes.size());
  chunk_ += start.bytes();
  chunk_ += bytes;
}

void McapWriter::flush_chunk() {
  if (chunk_.empty()) return;
  const std::string packed = compression_ == Compression::none ? std::string() : compressed(compression_, chunk_);
  const std::string& stored = compression_ == Compression::none ? chunk_ : packed;
  ByteWriter start;
  start.u64(static_cast<uint64_t>(index_.first_ns)), start.u64(static_cast<uint64_t>(index_.last_ns));
  start.u64(chunk_.size());
  start.u32(crc_of(chunk_));
  text(start, name_of(compression_));
  start.u64(stored.size());
  index_.at = file_.size();
  file_.append(record_start(mcap::kChunk, start.bytes().size() + stored.size()) + start.bytes());
  file_.append(stored);
  index_.length = file_.size() - index_.at;
  index_.packed = stored.size(), index_.size = chunk_.size();
  for (const auto& [channel, entries] : entries_) {
    ByteWriter pairs;
    for (const Entry& entry : entries) pairs.u64(entry.time), pairs.u64(entry.offset);
    ByteWriter out;
    u16(out, channel);
    text(out, pairs.bytes());
    index_.index_at[channel] = file_.size();
    index_.counts[channel] = entries.size();
    file_.append(record(mcap::kMessageIndex, out));
  }
  index_.index_length = file_.size() - index_.at - index_.length;
  chunks_.push_back(index_);
  end_ = file_.size();
  index_ = {};
  entries_.clear();
  chunk_.clear();
}

std::string McapWriter::statistics() const {
  ByteWriter out;
  std::map<uint16_t, uint64_t> counts;
  for (size_t i = 0; i < channels_.size(); ++i) counts[static_cast<uint16_t>(i)] = 0;
  uint64_t all = 0;
  int64_t first_ns = chunks_.empty() ? 0 : chunks_[0].first_ns, last_ns = chunks_.empty() ? 0 : chunks_[0].last_ns;
  for (const ChunkIndex& chunk : chunks_) {
    for (const auto& [channel, count] : chunk.counts) counts[channel] += count, all += count;
    first_ns = std::min(first_ns, chunk.first_ns), last_ns = std::max(last_ns, chunk.last_ns);
  }
  out.u64(all);
  u16(out, static_cast<uint16_t>(schemas_.size()));
  out.u32(static_cast<uint32_t>(channels_.size()));
  out.u32(0);  // attachments
  out.u32(static_cast<uint32_t>(metadata_index_.size()));
  out.u32(static_cast<uint32_t>(chunks_.size()));
  out.u64(static_cast<uint64_t>(first_ns)), out.u64(static_cast<uint64_t>(last_ns));
  ByteWriter pairs;
  for (const auto& [channel, count] : counts) u16(pairs, channel), pairs.u64(count);
  text(out, pairs.bytes());
  return record(mcap::kStatistics, out);
}

void McapWriter::close() {
  flush_chunk();
  write_index();
  file_.commit();
}

void McapWriter::salvage() {
  if (end_ >= topics_at_) {
    file_.cut(end_);
    try {
      flush_chunk();
    } catch (const OutputError&) {
      chunk_.clear();
    }
  }
  commit_whole_chunks(file_, chunks_, end_, topics_at_, [this] { write_index(); });
}

void McapWriter::write_index() {
  ByteWriter no_crc;
  no_crc.u32(0);
  file_.append(record(mcap::kDataEnd, no_crc));

  std::vector<std::string> chunk_index;
  for (const ChunkIndex& chunk : chunks_) {
    ByteWriter pairs;
    for (const auto& [channel, at] : chunk.index_at) u16(pairs, channel), pairs.u64(at);
    ByteWriter out;
    out.u64(static_cast<uint64_t>(chunk.first_ns)), out.u64(static_cast<uint64_t>(chunk.last_ns));
    out.u64(chunk.at), out.u64(chunk.length);
    text(out, pairs.bytes());
    out.u64(chunk.index_length);
    text(out, name_of(compression_));
    out.u64(chunk.packed), out.u64(chunk.size);
    chunk_index.push_back(record(mcap::kChunkIndex, out));
  }
  const uint64_t summary_at = file_.size();
  std::string summary, offsets;
  const auto add_group = [&](mcap::Op op, const std::vector<std::string>& records) {
    if (records.empty()) return;
    ByteWriter out;
    out.u8(op);
    out.u64(summary_at + summary.size());
    const size_t before = summary.size();
    for (const std::string& bytes : records) summary += bytes;
    out.u64(summary.size() - before);
    offsets += record(mcap::kSummaryOffset, out);
  };
  add_group(mcap::kSchema, schemas_);
  add_group(mcap::kChannel, channels_);
  add_group(mcap::kStatistics, {statistics()});
  add_group(mcap::kChunkIndex, chunk_index);
  add_group(mcap::kMetadataIndex, metadata_index_);
  const uint64_t offsets_at = summary_at + summary.size();
  summary += offsets;

  ByteWriter footer;
  footer.u64(summary_at), footer.u64(offsets_at);
  summary += record_start(mcap::kFooter, mcap::kFooterSize) + footer.bytes();
  ByteWriter crc;
  crc.u32(crc_of(summary));
  file_.append(summary + crc.bytes());
  file_.append(mcap::kMagic);
}

}  // namespace dkb
