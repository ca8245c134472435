// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "dkb/devices/image_pairs.h"
#include "dkb_slam/source.h"

namespace dkb {

// What a device has given. Views hold until it is asked again.
struct DeviceImages {
  std::optional<DeviceImage> colour, depth;
  std::string broken;  // why an image that came could not be read
};

enum class DeviceState {
  images,     // at least one image
  waiting,    // none in time
  unplugged,  // it is gone; reopen() tries again
  ended,      // of recordings
};

// A camera of two streams, or a recording of one.
class ImageDevice {
 public:
  virtual ~ImageDevice() = default;
  // Waits at most `timeout_ms`. Throws InputError for what neither waiting nor plugging in again can mend.
  virtual DeviceState next(int timeout_ms, DeviceImages* images) = 0;
  // After it was unplugged: whether it is back.
  virtual bool reopen() = 0;
  virtual std::string description() const = 0;
  virtual std::vector<std::string> take_warnings() { return {}; }  // Source's
};

// The device's images as pairs. Gaps while it is unplugged are told once each.
class DeviceSource final : public Source {
 public:
  DeviceSource(std::unique_ptr<ImageDevice> device, const Camera& camera, const SourceOptions& options);

  const Camera& camera() const override { return camera_; }
  SourceFrame next() override;
  void stop() override;
  std::vector<std::string> take_warnings() override;
  SourceCounts counts() const override;
  std::string description() const override;

 private:
  bool wait_until_back();  // false: stopped
  void add(DeviceImage image, bool is_depth);
  // Nothing when the options leave the pair out.
  std::optional<SourceFrame> frame_of(const ImagePair& pair);

  const std::unique_ptr<ImageDevice> device_;
  const Camera camera_;
  const SourceOptions options_;
  ImagePairs pairs_;
  size_t seen_ = 0;    // pairs
  int64_t taken_ = 0;  // pairs from options_.start on
  std::optional<int64_t> first_stamp_;
  bool unplugged_ = false, ended_ = false;
  // The clocks of some devices start anew when they are plugged in again: then the time that has passed meanwhile goes
  // by this computer's clock.
  int64_t shift_ns_ = 0, last_stamp_ = 0;
  std::optional<std::chrono::steady_clock::time_point> gone_since_;
  std::atomic<int64_t> unpaired_{0}, late_{0};
  mutable std::mutex mutex_;
  std::vector<std::string> warnings_;
  std::condition_variable wake_;
  bool stopped_ = false;
};

}  // namespace dkb
