// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {

OutputFile::OutputFile(const std::filesystem::path& path) : path_(path), target_(behind_links(path)) {
  std::error_code unknown;
  const std::filesystem::file_status there = std::filesystem::status(path, unknown);
  if (std::filesystem::is_directory(there))
    throw InputError(path.string() + ": is a folder; a recording needs the name of a file");
  // Its index goes back to what was written; and what is no file must not be replaced by one.
  if (std::filesystem::exists(there) && !std::filesystem::is_regular_file(there))
    throw InputError(path.string() + ": is a device or a pipe; a recording needs the name of a file");
  temporary_ = temporary_beside(target_);
  fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd_ < 0) fail_to_write(path_, "open", errno);
}

OutputFile::~OutputFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

void OutputFile::fail(const char* what) const {
  throw OutputError(path_.string() + ": cannot be written (" + what + ": " + std::strerror(errno) + ")");
}

void OutputFile::write_at(uint64_t at, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("write");
    bytes.remove_prefix(static_cast<size_t>(n));
    at += static_cast<uint64_t>(n);
  }
}

void OutputFile::append(std::string_view bytes) {
  write_at(size_, bytes);
  size_ += bytes.size();
}

void OutputFile::overwrite(uint64_t at, std::string_view bytes) {
  write_at(at, bytes);
}

void OutputFile::cut(uint64_t size) {
  if (::ftruncate(fd_, static_cast<off_t>(size)) != 0) fail("truncate");
  size_ = size;
}

void OutputFile::sync() {
  if (::fsync(fd_) != 0 && errno != EINVAL && errno != EROFS) fail("fsync");
}

void OutputFile::commit() {
  sync();
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename");
  ::close(fd_);
  fd_ = -1;
}

}  // namespace dkb
