// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace dkb {

// A file of a session is the page's stream in chunks: a message of kind `moment` and the messages that belong to it.
// Who goes forward from the beginning leaves out the checkpoints; who begins at one needs nothing that is before it.
inline constexpr uint32_t kCheckpoint = 1;  // all that a late client is told; what came before is void
inline constexpr uint32_t kSessionEnd = 2;  // the session has ended
inline constexpr size_t kChunkHead = 32;    // [bytes]

struct SessionChunk {
  uint32_t flags = 0;
  double seconds = 0;  // since the first frame; never falls
  int frame = -1;
  uint32_t bytes = 0;  // that follow the head
};
std::string chunk_head(const SessionChunk& chunk);
// Nothing when these kChunkHead bytes are no chunk's head.
std::optional<SessionChunk> parse_chunk_head(const char* bytes);

// What of a session's file lies where. The file may grow meanwhile; a chunk that is not whole yet is not seen.
class SessionFile {
 public:
  // Throws InputError when it cannot be read or is something else.
  explicit SessionFile(const std::filesystem::path& path);
  ~SessionFile();
  SessionFile(const SessionFile&) = delete;
  SessionFile& operator=(const SessionFile&) = delete;

  // Looks for further chunks, some 20,000 at most: of a session of many hours the beginning is there at once.
  void update();

  // A place to begin at.
  struct Entry {
    double seconds = 0;
    int frame = -1;
    uint64_t offset = 0;
  };
  static constexpr size_t kMaxEntries = 2000;
  const std::vector<Entry>& entries() const { return entries_; }  // evenly spread, where there would be too many
  double seconds() const { return last_.seconds; }                // of the last chunk
  int frame() const { return last_.frame; }
  int frames() const { return frames_; }   // that were recorded
  uint64_t size() const { return size_; }  // of the whole chunks
  bool ended() const { return ended_; }
  bool damaged() const { return damaged_; }  // what follows size() is no chunk

  // Bytes [from, to) of the file, as far as there are; `to` at most size().
  std::string read(uint64_t from, uint64_t to) const;

 private:
  int fd_ = -1;
  std::vector<Entry> entries_;
  size_t checkpoints_ = 0, keep_every_ = 1;
  SessionChunk last_;
  int frames_ = 0;
  uint64_t size_ = 0;
  bool ended_ = false, damaged_ = false;
};

}  // namespace dkb
