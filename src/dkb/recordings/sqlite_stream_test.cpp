// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/sqlite_stream.h"

#include <gtest/gtest.h>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/recordings/convert.h"
#include "dkb/recordings/recording_test_tools.h"
#include "dkb/util/test_errors.h"

#if DKB_HAS_SQLITE3
#include <sqlite3.h>

namespace dkb::test {
namespace {

using namespace std::string_literals;

void run_sql(const std::filesystem::path& path, const std::string& sql) {
  std::filesystem::remove(path);
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  char* error = nullptr;
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, &error), SQLITE_OK) << error;
  sqlite3_close(database);
}

// Tables as rosbag2 makes them.
const char* kTables =
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT "
    "NULL, offered_qos_profiles TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
    "NOT "
    "NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    "INSERT INTO topics VALUES(1, '/chatter', 'std_msgs/msg/String', 'cdr', '');"
    "INSERT INTO topics VALUES(2, '/other', 'std_msgs/msg/String', 'cdr', '');";

std::string row(int id, int topic, int64_t ns, const char* hex) {
  return "INSERT INTO messages VALUES(" + std::to_string(id) + ", " + std::to_string(topic) + ", " +
         std::to_string(ns) + ", X'0001000003000000" + hex + "00');";
}

TEST(SqliteMessages, AreReadInTheOrderOfTheirTime) {
  const TempFolder scratch;
  run_sql(scratch / "a.db3", kTables + row(1, 1, 30, "6969") + row(2, 2, 10, "6868") + row(3, 1, 20, "6A6A"));
  const auto stream = open_messages(scratch / "a.db3");
  ASSERT_EQ(stream->topics().size(), 2U);
  EXPECT_EQ(stream->topics()[0].type, "std_msgs/String");
  EXPECT_EQ(stream->topics()[0].count, 2);
  std::string read;
  for (const Kept& m : read_all(*stream)) read += m.topic + decode_string(m.bytes, MessageEncoding::cdr);
  EXPECT_EQ(read, "/otherhh/chatterjj/chatterii");
  stream->select({"/chatter"});
  stream->rewind();
  EXPECT_EQ(read_all(*stream).size(), 2U);
  EXPECT_TRUE(stream->take_warnings().empty());
}

TEST(SqliteMessages, ATopicWithoutMessagesIsKnownToHaveNone) {
  const TempFolder scratch;
  run_sql(scratch / "a.db3", kTables + row(1, 1, 30, "6969"));
  EXPECT_EQ(open_messages(scratch / "a.db3")->topics()[1].count, 0);
}

TEST(SqliteMessages, TopicsThatCannotBeConvertedAreTold) {
  const TempFolder scratch;
  run_sql(scratch / "a.db3", kTables + row(1, 1, 30, "6969") + row(2, 3, 10, "6868") +
                                 "INSERT INTO topics VALUES(3, '/path', 'nav_msgs/msg/Path', 'cdr', '');");
  std::vector<std::string> warnings;
  ConvertOptions options;
  options.warn = [&](const std::string& line) { warnings.push_back(line); };
  EXPECT_EQ(convert(scratch / "a.db3", scratch / "a.mcap", options).count, 1U);
  EXPECT_EQ(warnings, std::vector<std::string>{(scratch / "a.db3").string() +
                                               ": topic /path of type nav_msgs/Path is left out; its type is not "
                                               "converted from ROS 2"});
  const auto stream = open_messages(scratch / "a.mcap");
  for (const RecordedTopic& topic : stream->topics()) EXPECT_NE(topic.name, "/path");
}

TEST(SqliteMessages, NothingIsWrittenBesideTheFile) {
  const TempFolder scratch;
  std::filesystem::create_directory(scratch / "x?%#");
  const auto path = scratch / "x?%#/a.db3";
  run_sql(path, "PRAGMA journal_mode = WAL;"s + kTables + row(1, 1, 30, "6969"));
  EXPECT_EQ(read_all(*open_messages(path)).size(), 1U);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path.parent_path()), {}), 1);
}

TEST(SqliteMessages, OtherDatabasesAreRefused) {
  const TempFolder scratch;
  run_sql(scratch / "a.db3", "CREATE TABLE cars(id INTEGER);");
  EXPECT_NE(input_error_of([&] { open_messages(scratch / "a.db3"); }).find("no tables `topics` and `messages`"),
            std::string::npos);
  run_sql(scratch / "b.db3",
          "CREATE TABLE topics(id, name, type, serialization_format); CREATE VIEW messages AS WITH RECURSIVE n(i) AS "
          "(SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS topic_id, i AS timestamp, 1 AS data FROM n;");
  EXPECT_NE(input_error_of([&] { open_messages(scratch / "b.db3"); }).find("no tables"), std::string::npos);
}

TEST(SqliteMessages, DamagedFilesDoNothingWorseThanEnd) {
  const TempFolder scratch;
  std::string rows = "PRAGMA page_size = 1024;"s + kTables;
  for (int i = 1; i <= 40; ++i) rows += row(i, i % 3, i * 7 % 40, "6969");
  run_sql(scratch / "a.db3", rows);
  const std::string whole = read_file(scratch / "a.db3");
  Random random(3);
  int opened = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = whole;
    if (i % 4 == 0) bytes = mutated(bytes, random);
    for (uint32_t n = 1 + random.below(20); n > 0 && !bytes.empty(); --n)
      bytes[random.below(static_cast<uint32_t>(bytes.size()))] = static_cast<char>(random.below(256));
    write_bytes(scratch / "b.db3", bytes);
    try {
      const auto stream = open_messages(scratch / "b.db3");
      EXPECT_LT(read_all(*stream).size(), 10'000U);
      ++opened;
    } catch (const InputError&) {
    }
  }
  EXPECT_GT(opened, 200);
}

}  // namespace
}  // namespace dkb::test
#endif
