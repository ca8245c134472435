// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_survey.h"

#include <algorithm>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr const char* kCameraTopic = "/dkb_slam/camera";
constexpr const char* kCameraText = "dkb_slam_camera";
constexpr const char* kTransforms = "/tf_static";

bool is_image(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage";
}

// What the survey waits for, where it is there.
bool is_of_use(const RecordedTopic& topic, const SourceOptions& options) {
  if (is_image(topic.type)) {
    // Where both are named, no other one matters.
    if (options.colour_topic.empty() || options.depth_topic.empty()) return true;
    return topic.name == options.colour_topic || topic.name == options.depth_topic;
  }
  if (topic.type == "nav_msgs/Odometry" || topic.type == "sensor_msgs/Imu") return options.prior != PriorKind::none;
  return topic.type == "sensor_msgs/CameraInfo" || topic.name == kCameraTopic || topic.name == kTransforms;
}

}  // namespace

const RecordedImageTopic* RecordingSurvey::image(const std::string& name) const {
  const auto found = std::find_if(images.begin(), images.end(), [&](const auto& i) { return i.name == name; });
  return found == images.end() ? nullptr : &*found;
}

bool RecordingSurvey::shown(const RecordedTopic& topic) const {
  if (is_image(topic.type)) return image(topic.name) != nullptr;
  if (topic.type == "sensor_msgs/CameraInfo") return infos.contains(topic.name);
  if (topic.type == "nav_msgs/Odometry") return odometries.contains(topic.name);
  if (topic.type == "sensor_msgs/Imu") return inertial.contains(topic.name);
  if (topic.name == kTransforms) return transform_messages_ >= topic.count.value_or(1);
  return camera_file.has_value();
}

bool RecordingSurvey::complete(const std::vector<RecordedTopic>& topics, const SourceOptions& options) const {
  return std::all_of(topics.begin(), topics.end(), [&](const RecordedTopic& topic) {
    return !is_of_use(topic, options) || topic.count == 0 || shown(topic);
  });
}

void RecordingSurvey::take(const RecordedTopic& topic, const RecordedMessage& message) {
  if (is_image(topic.type)) {
    if (image(topic.name) != nullptr) return;
    const RecordedImage seen = read_recorded_image(message.bytes, topic.type, topic.encoding, topic.name);
    images.push_back({topic.name, topic.type, seen.encoding, frame_name(seen.header.frame_id), seen.content, seen.width,
                      seen.height, seen.header.stamp_ns != 0});
  } else if (topic.type == "sensor_msgs/CameraInfo") {
    if (!infos.contains(topic.name)) infos.emplace(topic.name, decode_camera_info(message.bytes, topic.encoding));
  } else if (topic.type == "nav_msgs/Odometry") {
    if (!odometries.contains(topic.name))
      odometries.emplace(topic.name, decode_odometry(message.bytes, topic.encoding).child_frame_id);
  } else if (topic.type == "sensor_msgs/Imu") {
    if (!inertial.contains(topic.name))
      inertial.emplace(topic.name, decode_imu(message.bytes, topic.encoding).header.frame_id);
  } else if (topic.name == kTransforms) {
    ++transform_messages_;
    transforms.add(decode_transforms(message.bytes, topic.encoding));
  } else if (topic.name == kCameraTopic && topic.type == "std_msgs/String" && !camera_file) {
    camera_file = decode_string(message.bytes, topic.encoding);
    camera_file_origin = kCameraTopic;
  }
}

void RecordingSurvey::read(MessageStream& stream, const SourceOptions& options) {
  // After one image of colour and one of depth have come, what else there is should come soon.
  constexpr int kMaxImages = 300, kMaxMessages = 20'000;
  // Without an index topics are known only once they have come.
  constexpr int kMinMessages = 100;
  const std::map<std::string, std::string> texts = stream.metadata();
  if (const auto text = texts.find(kCameraText); text != texts.end())
    camera_file = text->second, camera_file_origin = std::string("metadata ") + kCameraText;
  const auto has = [&](ImageContent content, const std::string& name) {
    if (!name.empty()) return image(name) != nullptr;
    return std::any_of(images.begin(), images.end(), [&](const auto& i) { return i.content == content; });
  };
  for (int further_images = 0, further = 0;;) {
    const bool both = has(ImageContent::colour, options.colour_topic) && has(ImageContent::depth, options.depth_topic);
    if (both) {
      const std::vector<RecordedTopic>& topics = stream.topics();
      const bool indexed =
          std::all_of(topics.begin(), topics.end(), [](const RecordedTopic& t) { return t.count.has_value(); });
      if ((indexed || further >= kMinMessages) && complete(topics, options)) return;
      if (further_images >= kMaxImages || further >= kMaxMessages) return;
    }
    const std::optional<RecordedMessage> message = stream.next();
    if (!message) return;
    const RecordedTopic& topic = stream.topics()[message->topic];
    further += both, further_images += both && is_image(topic.type);
    try {
      take(topic, *message);
    } catch (const InputError& e) {  // perhaps its next one is sound
      if (is_image(topic.type) && first_failure.empty()) first_failure = e.what();
    }
  }
}

}  // namespace dkb
