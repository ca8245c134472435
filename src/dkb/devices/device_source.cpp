// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/device_source.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "dkb/dataset/camera_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr int kPollMs = 100;  // so long may stop() have to wait
constexpr std::chrono::milliseconds kReopenEvery{500};

std::string size_text(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

}  // namespace

Camera device_camera(const std::string& name, const Camera& told, const SourceOptions& options,
                     const std::string& untold) {
  Camera camera = told;
  if (!options.camera.empty()) {
    camera = choose_camera(options.camera, {}).camera;
  } else if (!(told.fx > 0)) {
    if (!options.fallback_camera) throw InputError(name + ": " + untold + "; give --camera FILE");
    camera = *options.fallback_camera;
  }
  if (camera.width != told.width || camera.height != told.height)
    throw InputError(name + ": its images are of " + size_text(told) + " px, the camera is of " + size_text(camera) +
                     "; give the camera that took them");
  if (camera.fps == 0) camera.fps = told.fps;
  if (told.depth_factor > 0) camera.depth_factor = told.depth_factor;
  try {
    camera.check();
  } catch (const InvalidOption& e) {
    throw InputError(name + ": " + e.what() + "; give --camera FILE");
  }
  return camera;
}

DeviceSource::DeviceSource(std::unique_ptr<ImageDevice> device, const Camera& camera, const SourceOptions& options)
    : device_(std::move(device)),
      camera_(camera),
      options_(options),
      filter_({options.skip_pairs, options.start, options.end, options.max_frames}) {}

void DeviceSource::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  wake_.notify_all();
}

SourceCounts DeviceSource::counts() const {
  SourceCounts counts;
  counts.unpaired = unpaired_;
  counts.late = late_;
  return counts;
}

std::vector<std::string> DeviceSource::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
}

std::string DeviceSource::description() const {
  return device_->description();
}

bool DeviceSource::wait_until_back() {
  do {
    std::unique_lock lock(mutex_);
    if (wake_.wait_for(lock, kReopenEvery, [&] { return stopped_; })) return false;
  } while (!device_->reopen());
  pairs_.restart();
  return true;
}

void DeviceSource::add(DeviceImage image, bool is_depth) {
  if (!is_stamp(image.stamp_ns)) return pairs_.add(image, is_depth);  // which counts it
  if (gone_since_) {
    if (image.stamp_ns + shift_ns_ <= last_stamp_)
      shift_ns_ = last_stamp_ - image.stamp_ns +
                  std::chrono::nanoseconds(std::chrono::steady_clock::now() - *gone_since_).count();
    gone_since_.reset();
  }
  image.stamp_ns += shift_ns_;
  pairs_.add(image, is_depth);
  if (!pairs_.behind()) return;
  pairs_.restart();  // as when it was unplugged: the clock starts anew, and stamps go on rising
  gone_since_ = std::chrono::steady_clock::now();
}

std::optional<SourceFrame> DeviceSource::frame_of(const ImagePair& pair) {
  const size_t index = seen_++;
  last_stamp_ = std::max(pair.colour.stamp_ns, pair.depth.stamp_ns);
  if (!filter_.wants(seconds_from_ns(pair.colour.stamp_ns))) return std::nullopt;
  SourceFrame frame;
  frame.index = index;
  frame.stamp = stamp_text(pair.colour.stamp_ns);
  try {
    frame.frame = Frame(options_.depth_limits ? camera_ : without_limits(camera_),
                        {pair.colour.stamp_ns, pair.colour.view, pair.depth.view, pair.depth.stamp_ns, {}});
    frame.state = SourceState::frame;
  } catch (const InputError& e) {
    frame.state = SourceState::skipped;
    frame.note = e.what();
  }
  return frame;
}

void DeviceSource::require_any() {
  if (filter_.seen() > 0 && !std::exchange(told_, true)) filter_.require_any(device_->description());
}

SourceFrame DeviceSource::next() {
  SourceFrame none;
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) return none;
    }
    if (unplugged_) {
      if (!wait_until_back()) return none;
      unplugged_ = false;
    }
    while (!filter_.done()) {
      const std::optional<ImagePair> pair = pairs_.take();
      if (!pair) break;
      if (std::optional<SourceFrame> frame = frame_of(*pair)) return *frame;
    }
    if (filter_.done()) {  // no wait for one more pair, which a camera may never give
      require_any();
      return none;
    }
    if (device_ended_) {
      pairs_.restart();  // what is left over has no partner
      unpaired_ = pairs_.unpaired();
      require_any();
      return none;
    }
    DeviceImages images;
    const DeviceState state = device_->next(kPollMs, &images);
    if (std::vector<std::string> lines = device_->take_warnings(); !lines.empty()) {
      const std::lock_guard lock(mutex_);
      warnings_.insert(warnings_.end(), lines.begin(), lines.end());
    }
    if (state == DeviceState::ended) {
      device_ended_ = true;
      pairs_.close();
      continue;
    }
    if (state == DeviceState::unplugged) {
      unplugged_ = true;
      gone_since_ = std::chrono::steady_clock::now();
      none.state = SourceState::unplugged;
      return none;
    }
    if (images.colour) add(*images.colour, false);
    if (images.depth) add(*images.depth, true);
    unpaired_ = pairs_.unpaired(), late_ = pairs_.late();
    if (!images.broken.empty()) {
      SourceFrame skipped;
      skipped.state = SourceState::skipped;
      skipped.index = seen_++;
      skipped.note = images.broken;
      return skipped;
    }
  }
}

}  // namespace dkb
