// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/util/errors.h"

namespace dkb {

// A file that grows under a name of its own and takes its place when it is whole; of a link, the place that it leads
// to. Throws OutputError.
class OutputFile {
 public:
  // Throws InputError when a folder, a device or a pipe has this name.
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();  // without commit() nothing is left behind
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void append(std::string_view bytes);
  void overwrite(uint64_t at, std::string_view bytes);
  void cut(uint64_t size);  // leaves the first bytes
  uint64_t size() const { return size_; }
  void sync();  // what was written is on the disk
  void commit();

 private:
  void write_at(uint64_t at, std::string_view bytes);
  [[noreturn]] void fail(const char* what) const;

  const std::filesystem::path path_, target_;
  std::string temporary_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

// Ends a file of chunks on a disk that is full: with as many of its whole `chunks`, of which the last ends at byte
// `end`, as leave room for the index. What comes before byte `least` must stay. Throws OutputError when no chunk can be
// kept.
template <class Chunk, class WriteIndex>
void commit_whole_chunks(OutputFile& file, std::vector<Chunk>& chunks, uint64_t end, uint64_t least,
                         const WriteIndex& write_index) {
  for (; !chunks.empty() && end > least; chunks.pop_back()) {
    file.cut(end);
    try {
      write_index();
      file.sync();
    } catch (const OutputError&) {  // the room that the last chunk takes is needed for the index
      end = chunks.back().at;
      continue;
    }
    return file.commit();  // fewer chunks would not help where this fails
  }
  throw OutputError("no message of the recording could be kept; make room on the disk");
}

}  // namespace dkb
