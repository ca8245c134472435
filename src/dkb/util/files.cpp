// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>

#include "dkb/util/errors.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

constexpr size_t kFirstPiece = 1 << 16;  // [bytes]

}  // namespace

std::string read_file(const fs::path& path) {
  std::error_code ec;
  if (fs::is_directory(path, ec)) throw InputError(path.string() + ": is a folder, a file was expected");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), std::fclose);
  if (!file) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  struct stat about {};
  const bool sized = ::fstat(::fileno(file.get()), &about) == 0 && about.st_size > 0;
  // With room for the read that finds the end. What is no plain file does not tell its size.
  std::string content(sized ? static_cast<size_t>(about.st_size) + 1 : kFirstPiece, '\0');
  size_t size = 0;
  while (const size_t n = std::fread(content.data() + size, 1, content.size() - size, file.get())) {
    size += n;
    if (size == content.size()) content.resize(2 * size);
  }
  if (std::ferror(file.get()) != 0) throw InputError(path.string() + ": reading fails half-way");
  content.resize(size);
  return content;
}

namespace {

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

}  // namespace

void fail_to_write(const fs::path& path, const std::string& what, int error, const std::string& kept) {
  const std::string message = path.string() + ": cannot be written (" + what + ": " + std::strerror(error) + ")";
  if (path.filename().empty()) throw InputError(message + "; give the name of a file");
  if (error == ENOENT || error == ENOTDIR) {
    std::error_code unknown;
    if (!fs::is_directory(folder_of(behind_links(path)), unknown))
      throw InputError(message + "; make the folder, or choose another");
    throw OutputError(message + "; something else took it away meanwhile" + kept);
  }
  for (const int place : {EISDIR, EACCES, EPERM, ENAMETOOLONG, ELOOP, EEXIST, ENOTEMPTY})
    if (error == place) throw InputError(message + "; choose another place");
  throw OutputError(message + kept);
}

fs::path behind_links(const fs::path& path) {
  constexpr int kMostLinks = 40;  // as many as Linux follows
  std::error_code error, unknown;
  fs::path target = fs::weakly_canonical(path, error);
  for (int i = 0; i < kMostLinks && !error && fs::is_symlink(fs::symlink_status(target, unknown)); ++i)
    target = fs::weakly_canonical(target.parent_path() / fs::read_symlink(target, unknown), error);
  return error ? path : target;
}

fs::path temporary_beside(const fs::path& target) {
  static std::atomic<uint64_t> made{0};
  return folder_of(target) /
         ("." + target.filename().string() + ".tmp" + std::to_string(::getpid()) + "-" + std::to_string(++made));
}

namespace {

// A device or a pipe is no file to be replaced.
bool is_device(const fs::path& path) {
  std::error_code unknown;
  const fs::file_status there = fs::status(path, unknown);
  return fs::exists(there) && !fs::is_regular_file(there) && !fs::is_directory(there);
}

}  // namespace

GrowingFile::GrowingFile(fs::path path, const std::string& ending)
    : path_(std::move(path)), target_(behind_links(path_)), straight_(is_device(path_)) {
  if (straight_) {
    fd_ = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);
  } else {
    temporary_ = ending.empty() ? temporary_beside(target_).string() : target_.string() + ending;
    fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  }
  if (fd_ < 0) fail("open");
}

GrowingFile::~GrowingFile() {
  if (fd_ >= 0) ::close(fd_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void GrowingFile::fail(const char* what) {
  const int error = errno;
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  if (!temporary_.empty()) ::unlink(std::exchange(temporary_, {}).c_str());
  fail_to_write(path_, what, error, straight_ ? "" : "; the previous file, if any, is kept");
}

void GrowingFile::append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("write");
    bytes.remove_prefix(static_cast<size_t>(n));
  }
}

void GrowingFile::commit() {
  if (::fsync(fd_) != 0 && errno != EINVAL && errno != EROFS) fail("fsync");
  if (::close(std::exchange(fd_, -1)) != 0) fail("close");
  if (straight_) return;
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename");
  temporary_.clear();
  const int dir = ::open(folder_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (dir >= 0) {
    ::fsync(dir);
    ::close(dir);
  }
}

void write_file_atomically(const fs::path& path, std::string_view content) {
  GrowingFile file(path);
  file.append(content);
  file.commit();
}

void make_output_folder(const fs::path& path) {
  std::error_code ec;
  fs::create_directories(path, ec);
  if (ec || !fs::is_directory(path, ec)) {
    const std::string message = path.string() + ": cannot make this output folder (" +
                                (ec ? ec.message() : "a file is in the way") + "); choose another with --out";
    if (ec == std::errc::no_space_on_device) throw OutputError(message);
    throw InputError(message);
  }
  if (::access(path.c_str(), W_OK | X_OK) != 0)
    throw InputError(path.string() + ": this output folder cannot be written; choose another with --out");
}

}  // namespace dkb
