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

#include "dkb/dataset/tum_dataset.h"
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

// The device's images as pairs. Throws InvalidOption; next() throws InputError when a recording ends and the options
// have left out all of its pairs. Gaps while it is unplugged are told once each.
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

  void require_any();  // throws once

  const std::unique_ptr<ImageDevice> device_;
  const Camera camera_;
  const SourceOptions options_;
  ImagePairs pairs_;
  PairFilter filter_;  // what the options choose
  size_t seen_ = 0;    // pairs, and images that could not be read
  bool unplugged_ = false, device_ended_ = false, told_ = false;
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

// The camera of a device or a recording of one: the option's, else what it tells (`told`; fx is 0 where it tells only
// the size of its images and their rate), else the fallback. The unit of depth is always the one that it tells (0:
// none). Throws InputError, which begins with `name`; `untold` says why fx is 0.
Camera device_camera(const std::string& name, const Camera& told, const SourceOptions& options,
                     const std::string& untold = "does not tell its camera");

}  // namespace dkb
