// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/rgbd_reader.h"

#include "dkb/util/errors.h"

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

void RgbdReaderOptions::check() const {
  require_option(queue >= 1 && queue <= 1000, "reader.queue", queue, "1 ... 1000 pairs");
  require_option(probed >= 1, "reader.probed", probed, "at least 1 pair");
}

RgbdReader::RgbdReader(PairStream pairs, const RgbdReaderOptions& options)
    : pairs_(std::move(pairs)), options_(options), queue_((options.check(), static_cast<size_t>(options.queue))) {
  probe();
  if (options_.threaded) thread_ = std::thread([this] { run(); });
}

RgbdReader::RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options)
    : RgbdReader((camera.check(), pairs_in_files(std::move(pairs), camera)), options) {}

RgbdReader::~RgbdReader() {
  stop();
  if (thread_.joinable()) thread_.join();
}

void RgbdReader::stop() {
  stopped_ = true;
  queue_.close();
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
  } catch (const std::exception& e) {  // a frame that cannot be had is a gap, whatever the reason
    decoded.skipped = e.what();
  }
  decoded.ms = watch.ms();
  return decoded;
}

std::optional<DatasetFrame> RgbdReader::read() {
  Probed next;
  if (!probed_.empty()) {
    next = std::move(probed_.front());
    probed_.pop_front();
  } else if (std::optional<StoredPair> pair = pairs_()) {
    next.pair = std::move(*pair);
  } else {
    return std::nullopt;
  }
  StoredPair& pair = next.pair;
  Decoded decoded = next.decoded ? std::move(*next.decoded) : decode(pair);
  {
    const std::lock_guard lock(mutex_);
    times_.add("decoding", decoded.ms);
  }
  return DatasetFrame{
      next_index_++,         pair.timestamp,           pair.stamp_ns,         pair.depth_stamp_ns,
      std::move(pair.stamp), std::move(decoded.image), std::move(pair.prior), std::move(decoded.skipped)};
}

void RgbdReader::run() {
  try {
    while (!stopped_) {
      std::optional<DatasetFrame> frame = read();
      if (!frame || !queue_.push(std::move(*frame))) break;
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  queue_.close();
}

std::optional<DatasetFrame> RgbdReader::next() {
  if (stopped_) return std::nullopt;
  if (!options_.threaded) return read();
  std::optional<DatasetFrame> frame = queue_.pop();
  if (stopped_) return std::nullopt;
  if (!frame) {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
  }
  return frame;
}

StageTimes RgbdReader::times() const {
  const std::lock_guard lock(mutex_);
  return times_;
}

}  // namespace dkb
