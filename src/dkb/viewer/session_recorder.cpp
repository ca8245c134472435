// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_recorder.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>

#include "dkb/util/errors.h"
#include "dkb/util/thread_priority.h"
#include "dkb/viewer/session_file.h"

namespace dkb {
namespace {

constexpr size_t kCheckpointEvery = 1 << 20;           // [bytes] at least
constexpr uintmax_t kLeftFree = uintmax_t{256} << 20;  // [bytes] of the disk, which others need too

}  // namespace

SessionRecorder::SessionRecorder(SessionModel& model, const std::filesystem::path& file, bool realtime)
    : model_(model), path_(file), realtime_(realtime), file_(std::fopen(file.c_str(), "wbe"), &std::fclose) {
  if (file_ == nullptr) throw OutputError(file.string() + ": cannot be written (" + std::strerror(errno) + ")");
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
      model_.say(std::string("the recording has ended: ") + e.what());
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
    std::error_code unknown;
    const auto space = std::filesystem::space(path_, unknown);
    if (!unknown && space.available < kLeftFree) throw OutputError("less than 256 MB are left on the disk");
  }
  return !ended && !last;
}

void SessionRecorder::write(const std::string& chunk) {
  if (std::fwrite(chunk.data(), 1, chunk.size(), file_.get()) != chunk.size() || std::fflush(file_.get()) != 0)
    throw OutputError(path_.string() + ": " + std::strerror(errno));
}

}  // namespace dkb
