// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include <algorithm>

#include "dkb/util/errors.h"
#include "dkb/util/thread_priority.h"
#include "dkb/util/thrown.h"

namespace dkb {
namespace {

constexpr size_t kQueue = 4;  // [pairs] ahead of the consumer, decoded or being decoded
constexpr int kWorkers = 2;   // [threads] that decode a pair each
constexpr int kProbed = 5;    // [pairs] looked at before the first is handed out

}  // namespace

struct RgbdReader::Decoded {
  std::shared_ptr<const RgbdImage> image;  // null when skipped
  std::string skipped;
  double ms = 0;
};

struct RgbdReader::Slot {
  StoredPair pair;
  size_t index = 0;
  bool begun = false;
  std::optional<Decoded> decoded;
};

RgbdReader::RgbdReader(PairStream pairs, const RgbdReaderOptions& options)
    : pairs_(std::move(pairs)), options_(options) {
  probe();
  if (!options_.threaded) return;
  try {
    threads_.emplace_back([this] { fetch_ahead(); });
    for (int i = 0; i < kWorkers; ++i) threads_.emplace_back([this] { decode_ahead(); });
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
  for (std::thread& thread : threads_) thread.join();
}

void RgbdReader::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  room_.notify_all();
  fetched_.notify_all();
  changed_.notify_all();
}

// Start-up pays for this, so it decodes as little as proves the point: pixels are decoded until one pair has proved
// sound; of the others the headers are looked at.
void RgbdReader::probe() {
  std::string first_failure;
  bool found_sound = false;
  for (int i = 0; i < kProbed; ++i) {
    std::optional<StoredPair> pair = pairs_();
    if (!pair) break;
    first_stamps_.push_back(pair->stamp_ns);
    probed_.push_back(std::make_shared<Slot>());
    Slot& probed = *probed_.back();
    probed.pair = std::move(*pair);
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

std::shared_ptr<RgbdReader::Slot> RgbdReader::fetch() {
  std::shared_ptr<Slot> next;
  if (!probed_.empty()) {
    next = std::move(probed_.front());
    probed_.pop_front();
  } else if (std::optional<StoredPair> pair = pairs_()) {
    next = std::make_shared<Slot>();
    next->pair = std::move(*pair);
  }
  if (!next) return nullptr;
  next->begun = next->decoded.has_value();
  next->index = next_index_++;
  return next;
}

// Threads for idle work may get no time beside other programs. This one has the share of any other: it takes pairs from
// the recording, and decodes what somebody waits for, who does nothing else meanwhile.
void RgbdReader::fetch_ahead() {
  std::unique_lock lock(mutex_);
  while (!stopped_) {
    if (!full())
      fetch_one(lock);
    else if (const std::shared_ptr<Slot> slot = waited_for())
      fill(lock, slot);
    else
      room_.wait(lock);
  }
}

void RgbdReader::fetch_one(std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  std::shared_ptr<Slot> next;
  std::exception_ptr failure;
  try {
    next = fetch();
  } catch (...) {
    failure = std::current_exception();
  }
  lock.lock();
  if (next) {
    ahead_.push_back(std::move(next));
    fetched_.notify_one();
  } else {
    ended_ = true, failure_ = failure;
    fetched_.notify_all();
  }
  changed_.notify_one();
}

void RgbdReader::decode_ahead() {
  set_thread_priority(ThreadPriority::idle);
  std::unique_lock lock(mutex_);
  while (!stopped_) {
    if (const std::shared_ptr<Slot> slot = next_to_decode())
      fill(lock, slot);
    else if (ended_)
      return;
    else
      fetched_.wait(lock);
  }
}

std::shared_ptr<RgbdReader::Slot> RgbdReader::next_to_decode() const {
  const auto slot = std::find_if(ahead_.begin(), ahead_.end(), [](const auto& s) { return !s->begun; });
  return slot == ahead_.end() ? nullptr : *slot;
}

// What nobody has begun first. When nothing is left to begin, the oldest pair once more: no clock decides whether the
// thread that has begun it is given time.
std::shared_ptr<RgbdReader::Slot> RgbdReader::waited_for() const {
  if (!waiting_ || oldest_ready()) return nullptr;
  if (auto slot = next_to_decode()) return slot;
  return ahead_.empty() ? nullptr : ahead_.front();
}

bool RgbdReader::oldest_ready() const {
  return ahead_.empty() ? ended_ : ahead_.front()->decoded.has_value();
}

bool RgbdReader::full() const {
  return ended_ || ahead_.size() >= kQueue;
}

void RgbdReader::fill(std::unique_lock<std::mutex>& lock, const std::shared_ptr<Slot>& slot) {
  slot->begun = true;
  lock.unlock();
  Decoded made = decode(slot->pair);
  lock.lock();
  if (slot->decoded) return;
  slot->decoded = std::move(made);
  changed_.notify_one();
}

DatasetFrame RgbdReader::hand_out(Slot& slot) {
  const StoredPair& pair = slot.pair;
  auto& [image, skipped, ms] = *slot.decoded;
  times_.add("decoding", ms);
  return {slot.index, pair.stamp_ns, pair.depth_stamp_ns, pair.stamp, std::move(image), pair.prior, std::move(skipped)};
}

std::optional<DatasetFrame> RgbdReader::next() {
  std::unique_lock lock(mutex_);
  if (!options_.threaded) {
    if (stopped_) return std::nullopt;
    lock.unlock();
    const std::shared_ptr<Slot> slot = fetch();
    if (slot && !slot->decoded) slot->decoded = decode(slot->pair);
    lock.lock();
    if (!slot) return std::nullopt;
    return hand_out(*slot);
  }
  waiting_ = !oldest_ready();
  if (waiting_) room_.notify_one();
  changed_.wait(lock, [this] { return stopped_ || oldest_ready(); });
  waiting_ = false;
  if (stopped_) return std::nullopt;
  if (ahead_.empty()) {
    if (failure_) std::rethrow_exception(failure_);
    return std::nullopt;
  }
  const std::shared_ptr<Slot> oldest = std::move(ahead_.front());
  ahead_.pop_front();
  room_.notify_one();
  return hand_out(*oldest);
}

StageTimes RgbdReader::times() const {
  const std::lock_guard lock(mutex_);
  return times_;
}

}  // namespace dkb
