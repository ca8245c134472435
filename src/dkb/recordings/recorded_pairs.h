// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "dkb/dataset/stored_pair.h"
#include "dkb/recordings/depth_registration.h"
#include "dkb/recordings/recording_contents.h"
#include "dkb/recordings/stamp_pairing.h"
#include "dkb_slam/source.h"

namespace dkb {

// The pairs of images in a stream of messages. One thread at a time calls next(), any thread the rest.
class RecordedPairs {
 public:
  // `name` opens the messages. `go_on` is called before each is read; next() throws what it throws.
  RecordedPairs(
      std::unique_ptr<MessageStream> stream, const RecordingContents& contents, const DatasetSelection& selection,
      std::string name, std::function<void()> go_on = [] {});

  // Nothing at the end, and after stop(). Throws InputError when the selection leaves nothing.
  std::optional<StoredPair> next();
  void stop() { stopped_ = true; }
  SourceCounts counts() const;
  std::vector<std::string> take_warnings();

 private:
  // How the images of one topic are read.
  struct Channel {
    RecordedImageTopic topic;
    MessageEncoding encoding = MessageEncoding::ros1;
    Camera camera;  // that took them
    RecordedImage read(const StampPairing::Stored& message) const;
    std::string mismatch(const StampPairing::Stored& message) const;
  };
  // What decoding needs; shared with the pairs, which may outlive the rest.
  struct Decoder {
    Channel colour, depth;
    std::optional<DepthRegistration> registration;
    std::string mismatch(const StampPairing::Pair& pair) const;
    std::shared_ptr<RgbdImage> decode(const StampPairing::Pair& pair) const;
  };

  void read_message();
  void add_image(StampPairing::Kind kind, const RecordedTopic& topic, const RecordedMessage& message);
  void add_motion(const RecordedTopic& topic, const RecordedMessage& message);
  void collect();
  bool is_too_large(const Channel& channel, const RecordedMessage& message);
  bool motion_is_known(const StampPairing::Pair& pair) const;
  StoredPair stored(StampPairing::Pair pair);
  void warn_of_clock();
  void warn_once(const std::string& kind, const std::string& line);

  const std::string name_;
  const std::function<void()> go_on_;
  const std::unique_ptr<MessageStream> stream_;
  const bool stamped_;
  const std::optional<RecordedMotionTopic> motion_topic_;
  const std::shared_ptr<Decoder> decoder_;
  MotionHistory motion_;  // of its topic, where there is one
  StampPairing pairing_;
  PairFilter filter_;
  std::deque<StampPairing::Pair> ready_;  // wait for what is known of the motion up to them
  size_t ready_bytes_ = 0;
  std::optional<int64_t> newest_colour_ns_, before_ns_;
  bool ended_ = false;
  int64_t broken_ = 0;               // [images] that cannot even be told the stamp of
  std::vector<std::string> warned_;  // kinds
  std::atomic<bool> stopped_{false};
  mutable std::mutex mutex_;
  SourceCounts counts_;
  std::vector<std::string> warnings_;
};

}  // namespace dkb
