// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/random.h"

namespace dkb::test {

// A recording that is a list of messages, in the ROS 1 encoding.
class MessageList final : public MessageStream {
 public:
  // Without an index topics are known once they have come.
  explicit MessageList(bool indexed = true) : indexed_(indexed) {}

  template <class Message>
  MessageList& add(const std::string& topic, const std::string& type, int64_t recorded_ns, const Message& message) {
    return add_bytes(topic, type, recorded_ns, encode(message));
  }
  MessageList& add_bytes(const std::string& topic, const std::string& type, int64_t recorded_ns, std::string bytes) {
    const auto found = std::find_if(all_.begin(), all_.end(), [&](const RecordedTopic& t) { return t.name == topic; });
    const auto index = static_cast<size_t>(found - all_.begin());
    if (found == all_.end()) all_.push_back({topic, type, MessageEncoding::ros1, 0});
    all_[index].count = *all_[index].count + 1;
    messages_.push_back({index, recorded_ns, std::move(bytes)});
    if (indexed_) topics_ = all_;
    return *this;
  }
  void add_text(const std::string& name, const std::string& text) { texts_[name] = text; }

  const std::vector<RecordedTopic>& topics() const override { return topics_; }
  void select(const std::vector<std::string>& names) override { selected_ = names; }
  std::optional<RecordedMessage> next() override {
    while (at_ < messages_.size()) {
      const Message& m = messages_[at_++];
      farthest_ = std::max(farthest_, at_);
      while (!indexed_ && topics_.size() <= m.topic) {
        topics_.push_back(all_[topics_.size()]);
        topics_.back().count.reset();
      }
      const std::string& name = all_[m.topic].name;
      if (!selected_.empty() && std::find(selected_.begin(), selected_.end(), name) == selected_.end()) continue;
      return RecordedMessage{m.topic, m.recorded_ns, m.bytes};
    }
    return std::nullopt;
  }
  void rewind() override { at_ = 0; }
  std::map<std::string, std::string> metadata() const override { return texts_; }
  std::vector<std::string> take_warnings() override { return {}; }

  struct Message {
    size_t topic = 0;
    int64_t recorded_ns = 0;
    std::string bytes;
  };
  std::vector<Message>& messages() { return messages_; }
  size_t farthest() const { return farthest_; }  // how many have been read

 private:
  bool indexed_;
  std::vector<RecordedTopic> all_, topics_;
  std::vector<Message> messages_;
  std::vector<std::string> selected_;
  std::map<std::string, std::string> texts_;
  size_t at_ = 0, farthest_ = 0;
};

constexpr int64_t kFirst = 1'305'031'102'000'000'000;
constexpr int64_t kInterval = 33'333'000;

inline Camera small_camera() {
  Camera camera;
  camera.width = 32, camera.height = 24, camera.fx = camera.fy = 30, camera.cx = 15.5, camera.cy = 11.5;
  return camera;
}

inline ColourImage noise_picture(uint64_t seed, int width = 32, int height = 24) {
  Random random(seed);
  ColourImage image(width, height);
  for (size_t i = 0; i < image.size(); ++i)
    image.data()[i] = {static_cast<uint8_t>(random.below(256)), static_cast<uint8_t>(random.below(256)),
                       static_cast<uint8_t>(random.below(256))};
  return image;
}

// Values in use, too near, too far, and none.
inline Image<uint16_t> noise_depth(uint64_t seed, int width = 32, int height = 24) {
  Random random(seed);
  Image<uint16_t> image(width, height);
  for (size_t i = 0; i < image.size(); ++i)
    image.data()[i] = static_cast<uint16_t>(random.below(5) == 0 ? 0 : random.below(65536));
  return image;
}

// `data` must outlive the message.
inline ImageMessage image_message(int64_t stamp_ns, const std::string& encoding, int width, int height,
                                  const std::string& data, const std::string& frame = "") {
  ImageMessage message;
  message.header = {stamp_ns, frame, 0};
  message.width = static_cast<uint32_t>(width), message.height = static_cast<uint32_t>(height);
  message.encoding = encoding;
  message.step = static_cast<uint32_t>(data.size() / static_cast<size_t>(height));
  message.data = data;
  return message;
}

inline std::string bytes_of(const ColourImage& image) {
  return {reinterpret_cast<const char*>(image.data()), 3 * image.size()};
}
inline std::string bytes_of(const Image<uint16_t>& image) {
  return {reinterpret_cast<const char*>(image.data()), 2 * image.size()};
}
inline std::string metres_of(const Image<uint16_t>& units, double factor = 5000) {
  std::string bytes;
  for (size_t i = 0; i < units.size(); ++i) {
    const auto metres = static_cast<float>(units.data()[i] / factor);
    bytes.append(reinterpret_cast<const char*>(&metres), sizeof metres);
  }
  return bytes;
}

inline void add_colour(MessageList& list, int n, const std::string& frame = "", const std::string& topic = "/rgb/image",
                       int64_t delay_ns = 0) {
  const std::string data = bytes_of(noise_picture(static_cast<uint64_t>(n)));
  const int64_t stamp = kFirst + n * kInterval;
  list.add(topic, "sensor_msgs/Image", stamp + delay_ns, image_message(stamp, "rgb8", 32, 24, data, frame));
}
inline void add_depth(MessageList& list, int n, const std::string& frame = "",
                      const std::string& topic = "/depth/image", int width = 32, int height = 24) {
  const std::string data = metres_of(noise_depth(static_cast<uint64_t>(1000 + n), width, height));
  const int64_t stamp = kFirst + n * kInterval + 4'000'000;
  list.add(topic, "sensor_msgs/Image", stamp, image_message(stamp, "32FC1", width, height, data, frame));
}
inline void add_pairs(MessageList& list, int first, int count, const std::string& frame = "") {
  for (int n = first; n < first + count; ++n) add_colour(list, n, frame), add_depth(list, n, frame);
}

inline CameraInfoMessage info_message(const Camera& camera, const std::string& frame = "") {
  CameraInfoMessage info;
  info.header = {kFirst, frame, 0};
  info.width = static_cast<uint32_t>(camera.width), info.height = static_cast<uint32_t>(camera.height);
  info.distortion_model = "plumb_bob";
  info.d = {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3};
  info.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  info.p = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return info;
}

inline TransformMessage transform_message(const std::string& parent, const std::string& child,
                                          const Rigid3& parent_from_child) {
  TransformMessage message;
  message.header = {kFirst, parent, 0};
  message.child_frame_id = child;
  message.transform = {parent_from_child.translation, parent_from_child.rotation};
  return message;
}

}  // namespace dkb::test
