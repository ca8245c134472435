// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "dkb/util/errors.h"
#include "dkb/viewer/map_deltas.h"

namespace dkb {
namespace {

constexpr size_t kPayload = kChunkHead - 8;
constexpr int kChunksAtOnce = 20000;
constexpr uint32_t kMaxChunk = 1U << 30;  // [bytes]

template <class T>
T number_at(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

}  // namespace

std::string chunk_head(const SessionChunk& chunk) {
  StreamWriter out;
  out.message(StreamMessage::moment, [&](StreamWriter& m) {
    m.put_bytes("DKBS");
    m.put(chunk.flags);
    m.put(chunk.seconds);
    m.put<int32_t>(chunk.frame);
    m.put(chunk.bytes);
  });
  return std::move(out.bytes());
}

std::optional<SessionChunk> parse_chunk_head(const char* bytes) {
  if (number_at<uint32_t>(bytes) != kPayload ||
      number_at<uint32_t>(bytes + 4) != static_cast<uint32_t>(StreamMessage::moment) ||
      std::memcmp(bytes + 8, "DKBS", 4) != 0)
    return std::nullopt;
  const SessionChunk chunk{number_at<uint32_t>(bytes + 12), number_at<double>(bytes + 16),
                           number_at<int32_t>(bytes + 24), number_at<uint32_t>(bytes + 28)};
  const bool sound =
      std::isfinite(chunk.seconds) && std::abs(chunk.seconds) < 1e9 && chunk.frame >= -1 && chunk.bytes <= kMaxChunk;
  return sound ? std::optional(chunk) : std::nullopt;
}

SessionFile::SessionFile(const std::filesystem::path& path)
    : fd_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (fd_ < 0) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  update();
  std::array<char, 16> start{};
  const ssize_t n = pread(fd_, start.data(), start.size(), 0);
  if (size_ > 0) return;
  const bool begins = n == static_cast<ssize_t>(start.size()) && std::memcmp(start.data() + 8, "DKBS", 4) == 0;
  close(fd_);
  throw InputError(path.string() + (n == 0   ? ": is empty"
                                    : begins ? ": is cut off before its first frame"
                                             : ": is not a recorded session; `run --record` and `live` write "
                                               "session.dkbs"));
}

SessionFile::~SessionFile() {
  close(fd_);
}

void SessionFile::update() {
  struct stat status {};
  if (damaged_ || fstat(fd_, &status) != 0 || !S_ISREG(status.st_mode)) return;
  const auto file_size = static_cast<uint64_t>(status.st_size);
  for (int n = 0; n < kChunksAtOnce && size_ + kChunkHead <= file_size; ++n) {
    std::array<char, kChunkHead> head{};
    if (pread(fd_, head.data(), head.size(), static_cast<off_t>(size_)) != static_cast<ssize_t>(head.size())) return;
    const std::optional<SessionChunk> chunk = parse_chunk_head(head.data());
    if (!chunk || (size_ > 0 && chunk->seconds < last_.seconds)) {
      damaged_ = true;
      return;
    }
    const uint64_t end = size_ + kChunkHead + chunk->bytes;
    if (end > file_size) return;
    const bool checkpoint = (chunk->flags & kCheckpoint) != 0;
    if (size_ == 0 || (checkpoint && ++checkpoints_ % keep_every_ == 0))
      entries_.push_back({chunk->seconds, chunk->frame, size_});
    if (entries_.size() > kMaxEntries) {
      for (size_t i = 1; 2 * i < entries_.size(); ++i) entries_[i] = entries_[2 * i];
      entries_.resize((entries_.size() + 1) / 2);
      keep_every_ *= 2;
    }
    if (!checkpoint && chunk->frame != last_.frame) ++frames_;
    ended_ = ended_ || (chunk->flags & kSessionEnd) != 0;
    last_ = *chunk;
    size_ = end;
  }
}

std::string SessionFile::read(uint64_t from, uint64_t to) const {
  std::string bytes(to > from ? std::min(to, size_) - std::min(from, size_) : 0, '\0');
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = pread(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(from + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace dkb
