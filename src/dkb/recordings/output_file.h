// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace dkb {

// A file that grows under a name of its own and takes its place when it is whole. Throws OutputError.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path);
  ~OutputFile();  // without commit() nothing is left behind
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void append(std::string_view bytes);
  void overwrite(uint64_t at, std::string_view bytes);
  void cut(uint64_t size);  // leaves the first bytes
  uint64_t size() const { return size_; }
  void commit();

 private:
  void write_at(uint64_t at, std::string_view bytes);
  [[noreturn]] void fail(const char* what) const;

  const std::filesystem::path path_;
  std::string temporary_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

}  // namespace dkb
