// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace dkb {

// Whole file as bytes. Throws InputError naming the file.
std::string read_file(const std::filesystem::path& path);

// What is replaced where `path` is written: what a link leads to, also where that is not there yet.
std::filesystem::path behind_links(const std::filesystem::path& path);

// What grows beside `target` until it takes its place: .NAME.tmpPID-N, another one at each call, since threads of one
// process may write the same file.
std::filesystem::path temporary_beside(const std::filesystem::path& target);

// Replaces `path` by `content` atomically: temporary file in the same folder, fsync, rename, fsync of the folder.
// A reader sees the old file or the new one, never a part. Links are followed; a device or a pipe is written straight.
// Throws as fail_to_write() does.
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

// A file that grows on the disk and takes the place of `path` when it is whole, as write_file_atomically() has it.
class GrowingFile {
 public:
  // Grows as temporary_beside() of what it takes the place of; or as NAME with `ending`, for files that are worth
  // looking at before they are whole. Throws as fail_to_write() does, here and below.
  explicit GrowingFile(std::filesystem::path path, const std::string& ending = "");
  ~GrowingFile();  // without commit() nothing is left behind
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;

  void append(std::string_view bytes);
  void commit();

 private:
  [[noreturn]] void fail(const char* what);

  const std::filesystem::path path_, target_;
  const bool straight_;    // a device or a pipe
  std::string temporary_;  // empty where it is written straight, and once it is whole
  int fd_ = -1;
};

// Throws that `path` cannot be written, with what was tried and the errno that it met: an InputError with the remedy
// where the place is wrong (no such folder, a folder of that name), an OutputError, with `kept` at its end, where the
// disk is full or broken or the file went away while it was written.
[[noreturn]] void fail_to_write(const std::filesystem::path& path, const std::string& what, int error,
                                const std::string& kept = "");

// Makes `path` (and its parents) and proves that files can be written there. Throws InputError for a folder that
// cannot be used, OutputError for a full disk.
void make_output_folder(const std::filesystem::path& path);

}  // namespace dkb
