// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr size_t kWindow = 16384;

}  // namespace

RecordingFile::RecordingFile(const std::filesystem::path& path) : name_(path.string()) {
  fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (fd_ < 0 || ::fstat(fd_, &status) != 0) {
    const std::string reason = std::strerror(errno);
    if (fd_ >= 0) ::close(fd_);
    throw InputError(name_ + ": cannot be read (" + reason + ")");
  }
  if (!S_ISREG(status.st_mode)) {
    ::close(fd_);
    throw InputError(name_ + ": is no file; a recording is read from a file on a disk");
  }
  size_ = static_cast<uint64_t>(status.st_size);
}

RecordingFile::~RecordingFile() {
  ::close(fd_);
}

std::string_view RecordingFile::peek(uint64_t at, size_t count) {
  if (at < window_at_ || at - window_at_ > window_size_ || window_size_ - (at - window_at_) < count) {
    const uint64_t left = at < size_ ? size_ - at : 0;
    const size_t wanted = static_cast<size_t>(std::min<uint64_t>(left, std::max(count, kWindow)));
    if (window_.size() < wanted) window_.resize(wanted);
    window_at_ = at;
    window_size_ = read(at, window_.data(), wanted);
  }
  const size_t from = static_cast<size_t>(at - window_at_);
  return {window_.data() + from, std::min(count, window_size_ - from)};
}

size_t RecordingFile::read(uint64_t at, char* out, size_t count) const {
  size_t done = 0;
  while (done < count && at + done < size_) {
    const ssize_t n = ::pread(fd_, out + done, count - done, static_cast<off_t>(at + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw InputError(name_ + ": reading fails half-way (" + std::strerror(errno) + ")");
    if (n == 0) break;  // it has become shorter
    done += static_cast<size_t>(n);
  }
  return done;
}

}  // namespace dkb
