// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/sqlite_stream.h"

#include "dkb/recordings/recorded_topics.h"
#include "dkb/util/errors.h"

#if DKB_HAS_SQLITE3
#include <sqlite3.h>

#include <set>
#endif

namespace dkb {

#if DKB_HAS_SQLITE3
namespace {

struct Close {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, Close>;

// Whether rows were written that the file itself does not hold yet.
bool has_journal(const std::filesystem::path& path) {
  for (const char* end : {"-wal", "-journal"}) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path.string() + end, error);
    if (!error && size > 0) return true;
  }
  return false;
}

// For SQLite: a file that nobody writes, so that none is made beside it.
std::string immutable_uri(const std::filesystem::path& path) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    if (c == '%' || c == '?' || c == '#') {
      constexpr char kHex[] = "0123456789ABCDEF";
      uri += {'%', kHex[static_cast<unsigned char>(c) >> 4], kHex[c & 15]};
    } else {
      uri += c;
    }
  }
  return uri + "?immutable=1";
}

class SqliteStream final : public MessageStream {
 public:
  explicit SqliteStream(const std::filesystem::path& path) : name_(path.string()) {
    sqlite3* made = nullptr;
    const std::string place = has_journal(path) ? path.string() : immutable_uri(path);
    const int opened = sqlite3_open_v2(place.c_str(), &made, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(made);
    if (opened != SQLITE_OK) throw InputError(name_ + ": cannot be read (" + sqlite3_errstr(opened) + ")");
    // The file may be made to waste time or memory.
    sqlite3_limit(made, SQLITE_LIMIT_LENGTH, 1 << 30);
    sqlite3_db_config(made, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(made, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    std::error_code error;
    steps_allowed_ = static_cast<int64_t>(10'000'000 + 64 * std::filesystem::file_size(path, error));
    sqlite3_progress_handler(
        made, kSteps, [](void* self) { return static_cast<SqliteStream*>(self)->waste() ? 1 : 0; }, this);
    read_topics();
  }

  const std::vector<RecordedTopic>& topics() const override { return topics_.all(); }
  void select(const std::vector<std::string>& names) override { topics_.select(names); }

  std::optional<RecordedMessage> next() override {
    if (ended_) return std::nullopt;
    if (rows_ == nullptr) {
      // Pixels are fetched for wanted rows alone, and never pass a sorter.
      rows_ = prepare("SELECT rowid, topic_id, timestamp FROM messages ORDER BY timestamp, rowid");
      data_ = prepare("SELECT data FROM messages WHERE rowid = ?1");
    }
    while (step(rows_)) {
      const auto topic = topic_of_.find(sqlite3_column_int64(rows_.get(), 1));
      if (topic == topic_of_.end() || !topics_.wanted(topic->second)) continue;
      sqlite3_reset(data_.get());
      sqlite3_bind_int64(data_.get(), 1, sqlite3_column_int64(rows_.get(), 0));
      if (!step(data_)) {
        if (ended_) break;
        continue;
      }
      const void* bytes = sqlite3_column_blob(data_.get(), 0);
      const size_t size = static_cast<size_t>(sqlite3_column_bytes(data_.get(), 0));
      return RecordedMessage{topic->second,
                             sqlite3_column_int64(rows_.get(), 2),
                             {static_cast<const char*>(bytes), bytes == nullptr ? 0 : size}};
    }
    ended_ = true;
    return std::nullopt;
  }

  void rewind() override {
    rows_.reset(), data_.reset();
    ended_ = false;
    steps_ = 0;
  }
  std::vector<std::string> take_warnings() override { return warnings_.take(); }

 private:
  static constexpr int kSteps = 100'000;  // of SQLite's machine between two calls of waste()

  bool waste() { return (steps_ += kSteps) > steps_allowed_; }

  [[noreturn]] void fail() {
    throw InputError(name_ + ": is no .db3 file of rosbag2 that can be read (" + sqlite3_errmsg(database_.get()) + ")");
  }

  Statement prepare(const char* query) {
    sqlite3_stmt* made = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query, -1, &made, nullptr) != SQLITE_OK) fail();
    return Statement(made);
  }

  // Whether there is a row. What is broken ends the recording.
  bool step(const Statement& statement) {
    const int result = sqlite3_step(statement.get());
    if (result == SQLITE_ROW) return true;
    if (result != SQLITE_DONE) {
      warnings_.add(name_ + ": is broken (" + sqlite3_errmsg(database_.get()) + "); it is read up to there");
      ended_ = true;
    }
    return false;
  }

  static std::string text(const Statement& row, int column) {
    const void* bytes = sqlite3_column_blob(row.get(), column);
    const size_t size = static_cast<size_t>(sqlite3_column_bytes(row.get(), column));
    return bytes == nullptr ? std::string() : std::string(static_cast<const char*>(bytes), size);
  }

  void read_topics() {
    // A view could compute for ever.
    const Statement tables = prepare(
        "SELECT COUNT(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages') "
        "AND sql LIKE 'CREATE TABLE%'");
    if (sqlite3_step(tables.get()) != SQLITE_ROW) fail();
    if (sqlite3_column_int(tables.get(), 0) != 2)
      throw InputError(name_ + ": is a database, but no rosbag2 recording: it has no tables `topics` and `messages`");
    const Statement rows = prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    std::set<std::string> foreign;
    while (step(rows)) {
      const std::string format = text(rows, 3);
      if (format != "cdr") {
        if (foreign.size() < 5) foreign.insert(format.substr(0, 40));
        continue;
      }
      if (const auto topic = topics_.add(text(rows, 1), text(rows, 2), MessageEncoding::cdr))
        topic_of_[sqlite3_column_int64(rows.get(), 0)] = *topic;
    }
    if (topics_.all().empty() && !foreign.empty())
      warnings_.add(name_ + ": its messages are encoded as " + *foreign.begin() + "; cdr is read");
    const Statement counts = prepare("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id");
    while (step(counts)) {
      const auto topic = topic_of_.find(sqlite3_column_int64(counts.get(), 0));
      if (topic != topic_of_.end()) topics_.add_count(topic->second, sqlite3_column_int64(counts.get(), 1));
    }
    if (!ended_) topics_.count_rest();
    ended_ = false;
  }

  std::string name_;
  std::unique_ptr<sqlite3, Close> database_;
  int64_t steps_ = 0, steps_allowed_ = 0;
  RecordedTopics topics_;
  RecordingWarnings warnings_;
  std::map<int64_t, size_t> topic_of_;
  Statement rows_, data_;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<MessageStream> open_sqlite_messages(const std::filesystem::path& path) {
  return std::make_unique<SqliteStream>(path);
}

#else

std::unique_ptr<MessageStream> open_sqlite_messages(const std::filesystem::path& path) {
  throw InputError(path.string() + ": this build cannot read .db3 files; install libsqlite3-dev and build again");
}

#endif

}  // namespace dkb
