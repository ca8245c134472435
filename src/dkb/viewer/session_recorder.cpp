// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_recorder.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/thread_priority.h"
#include "dkb/viewer/session_file.h"

namespace dkb {
namespace {

constexpr size_t kCheckpointEvery = 1 << 20;  // [bytes] at least

// A new file in the place of an earlier recording, whose bytes stay for whoever is watching it.
std::FILE* open_anew(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path target = behind_links(path);
  if (!std::filesystem::is_regular_file(target, error)) return std::fopen(path.c_str(), "wbe");
  std::filesystem::path fresh = target;
  fresh.replace_filename("." + target.filename().string() + ".tmp" + std::to_string(::getpid()));
  std::FILE* file = std::fopen(fresh.c_str(), "wbe");
  if (file == nullptr || std::rename(fresh.c_str(), target.c_str()) == 0) return file;
  const int reason = errno;
  std::fclose(file);
  std::filesystem::remove(fresh, error);
  errno = reason;
  return nullptr;
}

}  // namespace

SessionRecorder::SessionRecorder(SessionModel& model, const std::filesystem::path& file, bool realtime,
                                 uintmax_t left_free)
    : model_(model), path_(file), realtime_(realtime), left_free_(left_free), file_(nullptr, &std::fclose) {
  require_room(0);  // before a file that may be there is replaced
  file_.reset(open_anew(file));
  if (file_ == nullptr) fail_to_write(file, "open", errno);
  std::setvbuf(file_.get(), nullptr, _IONBF, 0);  // else what could not be written would be tried again at the end
  client_.images = client_.depth = true;
  thread_ = std::thread([this] { run(); });
}

SessionRecorder::~SessionRecorder() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void SessionRecorder::wake() {
  {
    const std::lock_guard lock(mutex_);
    ++woken_;
  }
  changed_.notify_all();
}

void SessionRecorder::wait_taken() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return over_ || taken_ == woken_; });
}

void SessionRecorder::run() {
  if (realtime_) set_thread_priority(ThreadPriority::background);  // else the feeding thread waits for this one
  for (bool more = true; more;) {
    uint64_t woken = 0;
    bool last = false;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || taken_ != woken_; });
      last = stopping_;
      woken = woken_;
    }
    try {
      more = write_news(last);
    } catch (const std::exception& e) {
      // The disk is full, or memory: the recording ends, the run goes on.
      more = false;
      const std::string line = std::string("the recording has ended: ") + e.what();
      model_.say(line);
      const std::lock_guard lock(mutex_);
      warnings_.push_back(line);
    }
    {
      const std::lock_guard lock(mutex_);
      taken_ = woken;
      over_ = !more;
    }
    changed_.notify_all();
  }
  file_.reset();
}

bool SessionRecorder::write_news(bool last) {
  StreamWriter news, whole;
  double seconds = 0;
  int frame = 0;
  bool ended = false;
  {
    const auto lock = model_.hold();
    model_.take_in();
    model_.take_in_map(realtime_ ? 10 : 1);
    model_.write(client_, news, std::numeric_limits<size_t>::max());
    seconds = seconds_ = std::max(seconds_, model_.seconds());  // a new world may begin with earlier stamps
    frame = model_.frame();
    ended = model_.ended();
    since_checkpoint_ += news.size();
    if (since_checkpoint_ > std::max(kCheckpointEvery, checkpoint_size_)) {
      // A client of its own who comes now.
      SessionModel::Client late;
      late.images = late.depth = true;
      model_.write(late, whole, std::numeric_limits<size_t>::max());
      since_checkpoint_ = 0;
      checkpoint_size_ = whole.size();
    }
  }
  if (news.size() > 0 || ended)
    write(chunk_head({ended ? kSessionEnd : 0, seconds, frame, static_cast<uint32_t>(news.size())}) + news.bytes());
  if (whole.size() > 0) {
    write(chunk_head({kCheckpoint, seconds, frame, static_cast<uint32_t>(whole.size())}) + whole.bytes());
  }
  return !ended && !last;
}

void SessionRecorder::write(const std::string& chunk) {
  require_room(chunk.size());
  if (std::fwrite(chunk.data(), 1, chunk.size(), file_.get()) != chunk.size()) {
    const std::string reason = std::strerror(errno);
    // Without its piece of a chunk the file is one that was cut off, which may be watched.
    const bool cut = ::ftruncate(::fileno(file_.get()), static_cast<off_t>(whole_)) == 0;
    throw OutputError(path_.string() + ": cannot be written (" + reason +
                      (cut ? "); what was recorded before is kept" : "); its end is damaged"));
  }
  whole_ += chunk.size();
}

void SessionRecorder::require_room(size_t bytes) const {
  std::error_code unknown;
  const std::filesystem::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
  const auto space = std::filesystem::space(folder, unknown);
  if (unknown || space.capacity == 0 || space.available >= left_free_ + bytes) return;
  throw OutputError(path_.string() + ": less than " + std::to_string(left_free_ >> 20) +
                    " MB would be left on the disk; make room there");
}

std::vector<std::string> SessionRecorder::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
}

}  // namespace dkb
