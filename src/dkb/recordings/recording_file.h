// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace dkb {

// A file that is read piece by piece, from any place. Its pages do not count as this program's memory.
class RecordingFile {
 public:
  explicit RecordingFile(const std::filesystem::path& path);  // throws InputError
  ~RecordingFile();
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;

  const std::string& name() const { return name_; }
  uint64_t size() const { return size_; }  // when it was opened
  // Up to `count` bytes, fewer at the end of the file; `at` may lie beyond it. Valid until the next call.
  std::string_view peek(uint64_t at, size_t count);
  // The same into `out`; returns how many there were.
  size_t read(uint64_t at, char* out, size_t count) const;

 private:
  std::string name_;
  int fd_ = -1;
  uint64_t size_ = 0;
  std::vector<char> window_;
  uint64_t window_at_ = 0;
  size_t window_size_ = 0;
};

// Memory that is used again from chunk to chunk and only grows.
struct ChunkBuffer {
  std::vector<char> bytes;
  size_t size = 0;  // how many of them count
  std::string_view view() const { return {bytes.data(), size}; }
};

enum class Compression { none, bz2, lz4, zstd };

// By its name in bags and mcap files; throws InputError, without a file's name, for another one and for one that was
// not built in.
Compression compression_named(std::string_view name);

// What became of a chunk. `cut`: the file ends in it, and `out` holds what comes before.
struct ChunkState {
  enum { whole, cut, broken } state = whole;
  std::string why;  // when it is broken
};

// The largest chunk that is read.
constexpr uint64_t kMaxChunk = uint64_t{1} << 30;

// Brings a chunk of `packed` bytes at `at` into `out`: `size` bytes, of which none is set aside before there is data
// for it.
ChunkState load_chunk(const RecordingFile& file, Compression compression, uint64_t at, uint64_t packed, uint64_t size,
                      ChunkBuffer* out);

// The same for bytes in memory, for writers: throws std::logic_error for a compression that was not built in.
std::string compressed(Compression compression, std::string_view bytes);

}  // namespace dkb
