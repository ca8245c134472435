// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/message_stream.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/map/byte_stream.h"
#include "dkb/recordings/mcap_format.h"
#include "dkb/recordings/recorded_topics.h"
#include "dkb/recordings/recording_test_tools.h"
#include "dkb/util/test_errors.h"

namespace dkb::test {
namespace {

using namespace std::string_literals;

struct Kind {
  const char* name;
  Compression compression;
};

// Those of this build.
std::vector<Kind> kinds() {
  std::vector<Kind> all = {{"a.bag", Compression::none}, {"a.mcap", Compression::none}};
  const auto add = [&](const char* name, const char* compression) {
    try {
      all.push_back({name, compression_named(compression)});
    } catch (const InputError&) {
      std::printf("skipped: this build has no %s\n", compression);
    }
  };
  add("a.bag", "bz2"), add("a.bag", "lz4"), add("a.mcap", "lz4"), add("a.mcap", "zstd");
  return all;
}

std::string label(const Kind& kind) {
  return std::string(kind.name) + " " + std::to_string(static_cast<int>(kind.compression));
}

// The most memory this process ever had. The sanitizers keep what was freed, so it says nothing there and is zero.
long peak_memory_mb() {
#ifdef DKB_SANITIZED
  return 0;
#endif
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

TEST(MessageStream, WhatIsWrittenIsReadBackInOrder) {
  const TempFolder scratch;
  const std::vector<Kept> messages = sample(5);
  for (const Kind& kind : kinds()) {
    SCOPED_TRACE(label(kind));
    write_sample(scratch / kind.name, messages, kind.compression);
    const auto stream = open_messages(scratch / kind.name);
    ASSERT_EQ(stream->topics().size(), 2U);
    EXPECT_EQ(stream->topics()[0].name, "/image");
    EXPECT_EQ(stream->topics()[0].type, "sensor_msgs/Image");
    EXPECT_EQ(stream->topics()[1].count, 5);
    EXPECT_EQ(read_all(*stream), messages);
    EXPECT_FALSE(stream->next());
    stream->rewind();
    EXPECT_EQ(read_all(*stream), messages);
    EXPECT_TRUE(stream->take_warnings().empty());
    if (kind.name == "a.mcap"s) {
      EXPECT_EQ(stream->metadata().at("note"), "a text\n");
    }
  }
}

TEST(MessageStream, OtherTopicsThanTheSelectedArePassedOver) {
  const TempFolder scratch;
  const std::vector<Kept> messages = sample(5);
  for (const Kind& kind : kinds()) {
    SCOPED_TRACE(label(kind));
    write_sample(scratch / kind.name, messages, kind.compression);
    const auto stream = open_messages(scratch / kind.name);
    stream->select({"/text"});
    EXPECT_EQ(read_all(*stream).size(), 5U);
    stream->select({"/image", "/nothing"});
    stream->rewind();
    EXPECT_EQ(read_all(*stream).size(), 5U);
  }
}

// One warning, and what was read is the beginning of what was written, as far as the bytes reach.
TEST(MessageStream, RecordingsThatAreCutOffAreReadUpToTheCut) {
  const TempFolder scratch;
  const std::vector<Kept> messages = sample(6, 40'000);
  for (const Kind& kind : kinds()) {
    SCOPED_TRACE(label(kind));
    write_sample(scratch / kind.name, messages, kind.compression);
    const std::string whole = read_file(scratch / kind.name);
    size_t before = 0;
    for (size_t size = 5000; size < whole.size(); size += whole.size() / 23) {
      write_bytes(scratch / "cut", whole.substr(0, size));
      const auto stream = open_messages(scratch / "cut");
      const std::vector<Kept> read = read_all(*stream);
      ASSERT_LE(read.size(), messages.size());
      EXPECT_TRUE(std::equal(read.begin(), read.end(), messages.begin())) << size;
      EXPECT_GE(read.size(), before);
      before = read.size();
      const std::vector<std::string> warnings = stream->take_warnings();
      EXPECT_EQ(warnings.size(), 1U) << size;
      if (!warnings.empty()) {
        EXPECT_NE(warnings[0].find("is cut off"), std::string::npos) << warnings[0];
      }
    }
    if (kind.compression == Compression::none) {
      EXPECT_GE(before, 10U);
    }
  }
}

TEST(MessageStream, ABrokenChunkIsLeftOutAndTold) {
  const TempFolder scratch;
  const std::vector<Kept> messages = sample(5);
  for (const Kind& kind : kinds()) {
    if (kind.compression == Compression::none && kind.name == "a.bag"s) continue;  // no checksum tells
    SCOPED_TRACE(label(kind));
    write_sample(scratch / kind.name, messages, kind.compression);
    std::string bytes = read_file(scratch / kind.name);
    bytes[bytes.size() / 3] = static_cast<char>(bytes[bytes.size() / 3] ^ 0x55);
    write_bytes(scratch / "broken", bytes);
    const auto stream = open_messages(scratch / "broken");
    const std::vector<Kept> read = read_all(*stream);
    EXPECT_GE(read.size(), 7U);
    EXPECT_LT(read.size(), 10U);
    for (const Kept& message : read) EXPECT_EQ(std::count(messages.begin(), messages.end(), message), 1);
    EXPECT_EQ(stream->take_warnings().size(), 1U);
  }
}

std::string bag_record(const std::string& fields, uint32_t data_size, const std::string& data) {
  ByteWriter out;
  out.u32(static_cast<uint32_t>(fields.size()));
  out.raw(fields);
  out.u32(data_size);
  out.raw(data);
  return out.take();
}

std::string bag_field(const std::string& name, const std::string& value) {
  ByteWriter out;
  out.u32(static_cast<uint32_t>(name.size() + 1 + value.size()));
  out.raw(name + "=" + value);
  return out.take();
}

TEST(MessageStream, WhatAFileClaimsSetsNoMemoryAside) {
  const TempFolder scratch;
  const std::string begin =
      "#ROSBAG V2.0\n" + bag_record(bag_field("op", "\x03") + bag_field("index_pos", "\0\0\0\0\0\0\0\0"s), 0, "");
  const std::string most = "\xFF\xFF\xFF\xFF";
  std::vector<std::string> files;
  for (const std::string compression : {"none", "bz2", "lz4"}) {
    for (const std::string& size : {most, "\x00\x00\x00\x40"s})
      files.push_back(
          begin + bag_record(bag_field("op", "\x05") + bag_field("compression", compression) + bag_field("size", size),
                             0xFFFFFFF0, "BZh9"));
  }
  files.push_back(begin + most);
  for (const std::string compression : {"", "lz4", "zstd"}) {
    ByteWriter out;
    out.raw(mcap::kMagic);
    out.u8(mcap::kChunk), out.u64(uint64_t{1} << 40);
    out.u64(0), out.u64(0), out.u64(uint64_t{1} << 30), out.u32(0);
    out.u32(static_cast<uint32_t>(compression.size()));
    out.raw(compression);
    out.u64((uint64_t{1} << 40) - 1000);
    out.raw("\x28\xB5\x2F\xFD");
    files.push_back(out.take());
  }
  const long before = peak_memory_mb();
  for (const std::string& bytes : files) {
    ASSERT_LE(bytes.size(), 200U);
    write_bytes(scratch / "claims", bytes);
    try {
      EXPECT_TRUE(read_all(*open_messages(scratch / "claims")).empty());
    } catch (const InputError& e) {  // of a build without this compression
      EXPECT_NE(std::string(e.what()).find("this build"), std::string::npos) << e.what();
    }
  }
  EXPECT_LT(peak_memory_mb() - before, 40);
}

std::string mcap_text(const std::string& value) {
  ByteWriter out;
  out.u32(static_cast<uint32_t>(value.size())), out.raw(value);
  return out.take();
}
std::string mcap_record(uint8_t op, const std::string& content) {
  ByteWriter out;
  out.u8(op), out.u64(content.size()), out.raw(content);
  return out.take();
}
std::string mcap_channel(const std::string& id, const std::string& topic, const std::string& encoding) {
  return mcap_record(mcap::kChannel, id + "\x01\x00"s + mcap_text(topic) + mcap_text(encoding) + mcap_text(""));
}

// A gigabyte of one letter packs into some kilobytes of a chunk.
TEST(MessageStream, NamesInsideChunksAreBounded) {
  const TempFolder scratch;
  const std::string name(1 << 17, 'x');
  const auto id = [](int i) { return std::string{static_cast<char>(i), '\x01'}; };
  std::string records;
  for (int i = 0; i < 20; ++i) {
    records += mcap_record(mcap::kSchema, id(i) + mcap_text(name) + mcap_text("") + mcap_text(""));
    records += mcap_channel(id(i), name, "cdr") + mcap_channel(id(i + 100), "/foreign", name);
  }
  records += mcap_record(mcap::kSchema, id(30) + mcap_text("a") + mcap_text(std::string(1 << 24, 'x')));
  records += mcap_channel("\x05\x00"s, "/chatter", "cdr");
  ByteWriter chunk;
  chunk.u64(0), chunk.u64(0), chunk.u64(records.size()), chunk.u32(0), chunk.u32(0);
  chunk.u64(records.size()), chunk.raw(records);
  write_bytes(scratch / "a.mcap", std::string(mcap::kMagic) + mcap_record(mcap::kChunk, chunk.bytes()));

  const auto connection = [&](int i, const std::string& topic, const std::string& type, size_t definition = 0) {
    const std::string data = bag_field("type", type) + bag_field("message_definition", std::string(definition, 'x'));
    return bag_record(bag_field("op", "\x07") + bag_field("conn", id(i) + "\x00\x00"s) + bag_field("topic", topic),
                      static_cast<uint32_t>(data.size()), data);
  };
  std::string connections = connection(98, "/large", "a/A", 1 << 22);
  for (int i = 0; i < 20; ++i) connections += connection(i, name, "a/A") + connection(i + 100, "/a", name);
  connections += connection(99, "/chatter", "a/A");
  write_bytes(scratch / "a.bag", "#ROSBAG V2.0\n" + bag_record(bag_field("op", "\x03"), 0, "") +
                                     bag_record(bag_field("op", "\x05") + bag_field("compression", "none"),
                                                static_cast<uint32_t>(connections.size()), connections));
  for (const char* file : {"a.mcap", "a.bag"}) {
    SCOPED_TRACE(file);
    const auto stream = open_messages(scratch / file);
    EXPECT_TRUE(read_all(*stream).empty());
    ASSERT_EQ(stream->topics().size(), 1u);
    EXPECT_EQ(stream->topics()[0].name, "/chatter");
    const std::vector<std::string> warnings = stream->take_warnings();
    ASSERT_EQ(warnings.size(), 10u);
    EXPECT_NE(warnings[5].find(" that is too l"), std::string::npos) << warnings[5];
  }
}

TEST(RecordedTopics, AreBoundedInNumberAndLength) {
  RecordedTopics topics;
  EXPECT_FALSE(topics.add(std::string(1025, 'x'), "a/A", MessageEncoding::cdr));
  EXPECT_FALSE(topics.add("/a", std::string(1025, 'x'), MessageEncoding::cdr));
  const std::string filling(1000, 'x');
  size_t added = 0;
  for (int i = 0; i < 20'000; ++i)
    added += topics.add(filling + std::to_string(i), "", MessageEncoding::cdr).has_value();
  EXPECT_LE(added * filling.size(), size_t{1} << 24);
  EXPECT_GT(added, 16'000u);
  EXPECT_EQ(topics.add(filling + "0", "", MessageEncoding::cdr), 0u) << "known";
}

// A channel, a message and no chunk, byte by byte as the format's specification has it; without a summary, unless one
// is given.
std::string plain_mcap(const std::string& encoding, const std::string& summary = "") {
  const std::string magic = "\x89MCAP0\r\n";
  const std::string data =
      magic + mcap_record(1, mcap_text("ros2") + mcap_text("somebody")) +
      mcap_record(3, "\x01\x00"s + mcap_text("std_msgs/msg/String") + mcap_text("ros2msg") + mcap_text("string data")) +
      mcap_channel("\x05\x00"s, "/chatter", encoding) +
      mcap_record(5, "\x05\x00\x00\x00\x00\x00"s + "\x02\x00\x00\x00\x00\x00\x00\x00"s + std::string(8, '\0') +
                         "\x00\x01\x00\x00\x03\x00\x00\x00hi\x00"s) +
      mcap_record(15, std::string(4, '\0'));
  ByteWriter footer;
  footer.u64(summary.empty() ? 0 : data.size()), footer.u64(0), footer.u32(0);
  return data + summary + mcap_record(2, footer.bytes()) + magic;
}

TEST(MessageStream, McapNeedsNoChunksAndNoSummary) {
  const TempFolder scratch;
  write_bytes(scratch / "plain", plain_mcap("cdr"));
  const auto stream = open_messages(scratch / "plain");
  ASSERT_EQ(stream->topics().size(), 1U);
  EXPECT_EQ(stream->topics()[0].type, "std_msgs/String");
  const auto message = stream->next();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->recorded_ns, 2);
  EXPECT_EQ(decode_string(message->bytes, stream->topics()[0].encoding), "hi");
  EXPECT_FALSE(stream->next());
  EXPECT_TRUE(stream->take_warnings().empty());
}

TEST(MessageStream, ABagsTopicWithoutMessagesIsKnownToHaveNone) {
  const TempFolder scratch;
  const auto writer = write_recording(scratch / "a.bag");
  writer->add_topic("/silent", "sensor_msgs/Imu");
  writer->write(writer->add_topic("/chatter", "std_msgs/String"), kStart, encode_string("hi"));
  writer->close();
  const auto stream = open_messages(scratch / "a.bag");
  ASSERT_EQ(stream->topics().size(), 2U);
  EXPECT_EQ(stream->topics()[0].count, 0);
  EXPECT_EQ(stream->topics()[1].count, 1);
}

// Statistics name the channels that have messages; where they do not add up, they say nothing of the others.
TEST(MessageStream, AnMcapsTopicWithoutMessagesIsKnownToHaveNone) {
  const TempFolder scratch;
  for (const uint64_t messages : {1, 2}) {
    ByteWriter count, statistics;
    count.raw("\x05\x00"s), count.u64(1);
    statistics.u64(messages), statistics.raw(std::string(2 + 4 * 4 + 2 * 8, '\0'));
    statistics.raw(mcap_text(count.bytes()));
    write_bytes(scratch / "a.mcap", plain_mcap("cdr", mcap_channel("\x05\x00"s, "/chatter", "cdr") +
                                                          mcap_record(mcap::kStatistics, statistics.bytes()) +
                                                          mcap_channel("\x06\x00"s, "/silent", "cdr")));
    const auto stream = open_messages(scratch / "a.mcap");
    ASSERT_EQ(stream->topics().size(), 2U);
    EXPECT_EQ(stream->topics()[0].count, 1);
    EXPECT_EQ(stream->topics()[1].name, "/silent");
    EXPECT_EQ(stream->topics()[1].count, messages == 1 ? std::optional<int64_t>(0) : std::nullopt);
    EXPECT_TRUE(stream->take_warnings().empty());
  }
}

// Each entry of the index costs as much as the record it names.
TEST(MessageStream, AnMcapIndexThatNamesOneTextManyTimesIsReadInTime) {
  const TempFolder scratch;
  ByteWriter out;
  out.raw(mcap::kMagic);
  const uint64_t at = out.bytes().size();
  const std::string metadata =
      mcap_text("note") + mcap_text(mcap_text("key") + mcap_text(std::string((1 << 24) - 100, 'x')));
  out.u8(mcap::kMetadata), out.u64(metadata.size()), out.raw(metadata);
  out.u8(mcap::kDataEnd), out.u64(4), out.u32(0);
  const uint64_t summary = out.bytes().size();
  for (int i = 0; i < 60'000; ++i) {
    out.u8(mcap::kMetadataIndex), out.u64(20);
    out.u64(at), out.u64(mcap::kRecordStart + metadata.size()), out.raw(mcap_text(""));
  }
  out.u8(mcap::kFooter), out.u64(mcap::kFooterSize), out.u64(summary), out.u64(0), out.u32(0);
  out.raw(mcap::kMagic);
  write_bytes(scratch / "a.mcap", out.bytes());
  EXPECT_EQ(open_messages(scratch / "a.mcap")->metadata().at("note").size(), size_t{(1 << 24) - 100});
}

TEST(MessageStream, EncodingsOfOthersAreToldWhenThereIsNothingElse) {
  const TempFolder scratch;
  write_bytes(scratch / "plain", plain_mcap("protobuf"));
  const auto stream = open_messages(scratch / "plain");
  EXPECT_FALSE(stream->next());
  const std::vector<std::string> warnings = stream->take_warnings();
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("encoded as protobuf; ros1 and cdr are read"), std::string::npos) << warnings[0];
}

TEST(MessageStream, WhatIsNoRecordingIsNamed) {
  const TempFolder scratch;
  const auto error = [&](const std::string& bytes) {
    write_bytes(scratch / "x.bag", bytes);
    return input_error_of([&] { open_messages(scratch / "x.bag"); });
  };
  EXPECT_NE(error("").find("x.bag: is empty"), std::string::npos);
  EXPECT_NE(error("hello").find("is no recording of a known kind"), std::string::npos);
  EXPECT_NE(error("#ROSBAG V1.2\n").find("version 1.2; version 2.0 is read"), std::string::npos);
  EXPECT_NE(error("#ROSBAG V2.0\n").find("without its header"), std::string::npos);
  EXPECT_NE(error("\x28\xB5\x2F\xFDxxxx").find("zstd -d"), std::string::npos);
  EXPECT_NE(input_error_of([&] { open_messages(scratch / "none"); }).find("no such file"), std::string::npos);
  EXPECT_NE(input_error_of([&] { open_messages(scratch / "."); }).find("is no folder of rosbag2"), std::string::npos);
}

TEST(MessageStream, UnknownCompressionIsNamed) {
  const TempFolder scratch;
  write_bytes(scratch / "x.bag", "#ROSBAG V2.0\n" + bag_record(bag_field("op", "\x03"), 0, "") +
                                     bag_record(bag_field("op", "\x05") + bag_field("compression", "rar"), 3, "abc"));
  const auto stream = open_messages(scratch / "x.bag");
  EXPECT_NE(input_error_of([&] { stream->next(); }).find("x.bag: is compressed with \"rar\""), std::string::npos);
}

TEST(MessageStream, FolderNamesItsFilesInOrder) {
  const TempFolder scratch;
  std::filesystem::create_directories(scratch / "trip");
  const std::vector<Kept> messages = sample(4, 1000);
  write_sample(scratch / "trip/b.mcap", {messages.begin(), messages.begin() + 3});
  write_sample(scratch / "trip/a.mcap", {messages.begin() + 3, messages.end()});
  const std::string info = "rosbag2_bagfile_information:\n  relative_file_paths: [trip/b.mcap, a.mcap]\n";
  write_bytes(scratch / "trip/metadata.yaml", info);
  const auto stream = open_messages(scratch / "trip");
  EXPECT_EQ(stream->topics()[0].count, 4);
  EXPECT_EQ(read_all(*stream), messages);
  stream->rewind();
  stream->select({"/text"});
  EXPECT_EQ(read_all(*stream).size(), 4U);
  EXPECT_EQ(stream->metadata().count("note"), 1U);

  // A recorder that was killed leaves no list.
  std::filesystem::remove(scratch / "trip/metadata.yaml");
  EXPECT_EQ(read_all(*open_messages(scratch / "trip")).size(), 8U);

  const auto error = [&](const std::string& yaml) {
    write_bytes(scratch / "trip/metadata.yaml", "rosbag2_bagfile_information:\n" + yaml);
    return input_error_of([&] { open_messages(scratch / "trip"); });
  };
  EXPECT_NE(error("  relative_file_paths: [a.db3.zstd]\n").find("a.db3.zstd: is compressed"), std::string::npos);
  EXPECT_NE(error("  compression_mode: MESSAGE\n  relative_file_paths: [a.mcap]\n").find("ros2 bag convert"),
            std::string::npos);
  EXPECT_NE(error("  relative_file_paths: []\n").find("names no files"), std::string::npos);
  EXPECT_NE(error("  relative_file_paths: [}\n").find("cannot be understood"), std::string::npos);
}

TEST(MessageStream, DamagedRecordingsDoNothingWorseThanEnd) {
  const TempFolder scratch;
  const std::vector<Kept> messages = sample(12, 300);
  const long before = peak_memory_mb();
  Random random(11);
  int opened = 0, tried = 0;
  for (const Kind& kind : kinds()) {
    write_sample(scratch / kind.name, messages, kind.compression);
    const std::string whole = read_file(scratch / kind.name);
    for (int i = 0; i < 500; ++i) {
      std::string bytes = mutated(whole, random);
      if (i % 2 == 0 && !bytes.empty()) bytes[random.below(static_cast<uint32_t>(bytes.size()))] ^= 4;
      write_bytes(scratch / "damaged", bytes);
      ++tried;
      try {
        const auto stream = open_messages(scratch / "damaged");
        stream->select({"/image", "/text"});
        EXPECT_LT(read_all(*stream).size(), 1000U);
        EXPECT_LE(stream->take_warnings().size(), 10U);
        ++opened;
      } catch (const InputError&) {
      }
    }
  }
  EXPECT_GT(opened, tried / 4);
  EXPECT_LT(peak_memory_mb() - before, 100);
}

}  // namespace
}  // namespace dkb::test
