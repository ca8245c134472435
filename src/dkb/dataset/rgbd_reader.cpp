// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include "dkb/util/errors.h"
#include "dkb/util/thread_priority.h"
#include "dkb/util/thrown.h"

namespace dkb {

struct RgbdReader::Decoded {
  std::shared_ptr<const RgbdImage> image;  // null when skipped
  std::string skipped;
  double ms = 0;
};

struct RgbdReader::Probed {
  StoredPair pair;
  std::optional<Decoded> decoded;
};

struct RgbdReader::Slot {
  DatasetFrame frame;
  double ms = 0;
  bool ready = false;
};

void RgbdReaderOptions::check() const {
  require_option(queue >= 1 && queue <= 1000, "reader.queue", queue, "1 ... 1000 pairs");
  require_option(workers >= 1 && workers <= 16, "reader.workers", workers, "1 ... 16 threads");
  require_option(probed >= 1, "reader.probed", probed, "at least 1 pair");
}

RgbdReader::RgbdReader(PairStream pairs, const RgbdReaderOptions& options)
    : pairs_(std::move(pairs)), options_((options.check(), options)) {
  probe();
  if (!options_.threaded) return;
  try {
    for (int i = 0; i < options_.workers; ++i) workers_.emplace_back([this] { run(); });
  } catch (...) {
    end();
    throw;
  }
}

RgbdReader::RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options)
    : RgbdReader((camera.check(), pairs_in_files(std::move(pairs), camera)), options) {}

RgbdReader::~RgbdReader() {
  end();
}

void RgbdReader::end() {
  stop();
  for (std::thread& worker : workers_) worker.join();
}

void RgbdReader::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  room_.notify_all();
  decoded_.notify_all();
}

// Start-up pays for this, so it decodes as little as proves the point: pixels are decoded until one pair has proved
// sound; of the others the headers are looked at.
void RgbdReader::probe() {
  std::string first_failure;
  bool found_sound = false;
  for (int i = 0; i < options_.probed; ++i) {
    std::optional<StoredPair> pair = pairs_();
    if (!pair) break;
    first_stamps_.push_back(pair->stamp_ns);
    probed_.push_back({std::move(*pair), std::nullopt});
    Probed& probed = probed_.back();
    std::string wrong;
    try {
      wrong = probed.pair.mismatch();
    } catch (const InputError& e) {
      if (first_failure.empty()) first_failure = e.what();
      continue;
    }
    if (!wrong.empty()) throw InputError(wrong);
    if (found_sound) continue;
    probed.decoded = decode(probed.pair);
    found_sound = probed.decoded->image != nullptr;
    if (!found_sound && first_failure.empty()) first_failure = probed.decoded->skipped;
  }
  if (!found_sound && !probed_.empty())
    throw InputError("none of the first " + std::to_string(probed_.size()) + " pairs can be decoded: " + first_failure);
}

RgbdReader::Decoded RgbdReader::decode(const StoredPair& pair) {
  const Stopwatch watch;
  Decoded decoded;
  try {
    decoded.image = pair.decode();
  } catch (...) {  // a frame that cannot be had is a gap, whatever the reason
    decoded.skipped = what_was_thrown();
  }
  decoded.ms = watch.ms();
  return decoded;
}

std::optional<RgbdReader::Probed> RgbdReader::fetch() {
  std::optional<Probed> next;
  if (!probed_.empty()) {
    next = std::move(probed_.front());
    probed_.pop_front();
  } else if (std::optional<StoredPair> pair = pairs_()) {
    next = Probed{std::move(*pair), std::nullopt};
  }
  return next;
}

RgbdReader::Slot RgbdReader::decoded(Probed next, size_t index) {
  StoredPair& pair = next.pair;
  Decoded decoded = next.decoded ? std::move(*next.decoded) : decode(pair);
  return {DatasetFrame{index, pair.timestamp, pair.stamp_ns, pair.depth_stamp_ns, std::move(pair.stamp),
                       std::move(decoded.image), std::move(pair.prior), std::move(decoded.skipped)},
          decoded.ms, true};
}

// Pairs are taken from the recording by one worker at a time, which adds the pair's place in the order before it lets
// the next one do so.
void RgbdReader::run() {
  set_thread_priority(ThreadPriority::background);
  std::unique_lock lock(mutex_);
  while (true) {
    room_.wait(lock, [this] {
      return stopped_ || ended_ || (!fetching_ && ahead_.size() < static_cast<size_t>(options_.queue));
    });
    if (stopped_ || ended_) return;
    fetching_ = true;
    lock.unlock();
    std::optional<Probed> pair;
    std::exception_ptr failure;
    try {
      pair = fetch();
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    fetching_ = false;
    if (!pair) {
      ended_ = true, failure_ = failure;
      room_.notify_all();
      decoded_.notify_one();
      return;
    }
    const size_t index = next_index_++;
    Slot& slot = ahead_.emplace_back();
    room_.notify_one();
    lock.unlock();
    Slot made = decoded(std::move(*pair), index);
    lock.lock();
    slot = std::move(made);
    decoded_.notify_one();
  }
}

DatasetFrame RgbdReader::hand_out(Slot slot) {
  times_.add("decoding", slot.ms);
  return std::move(slot.frame);
}

std::optional<DatasetFrame> RgbdReader::next() {
  std::unique_lock lock(mutex_);
  if (stopped_) return std::nullopt;
  if (!options_.threaded) {
    lock.unlock();
    std::optional<Probed> pair = fetch();
    if (!pair) return std::nullopt;
    Slot made = decoded(std::move(*pair), next_index_++);
    lock.lock();
    return hand_out(std::move(made));
  }
  decoded_.wait(lock, [this] { return stopped_ || (ahead_.empty() ? ended_ : ahead_.front().ready); });
  if (stopped_) return std::nullopt;
  if (ahead_.empty()) {
    if (failure_) std::rethrow_exception(failure_);
    return std::nullopt;
  }
  Slot oldest = std::move(ahead_.front());
  ahead_.pop_front();
  room_.notify_one();
  return hand_out(std::move(oldest));
}

StageTimes RgbdReader::times() const {
  const std::lock_guard lock(mutex_);
  return times_;
}

}  // namespace dkb
