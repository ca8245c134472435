// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recording_survey.h"

#include <algorithm>

#include "dkb/recordings/topic_names.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

bool is_indexed(const std::vector<RecordedTopic>& topics) {
  return std::all_of(topics.begin(), topics.end(), [](const RecordedTopic& t) { return t.count.has_value(); });
}

// A name was picked that an index does not have.
bool is_hopeless(const std::vector<RecordedTopic>& topics, const SourceOptions& options) {
  const auto missing = [&](const std::string& picked) {
    return !picked.empty() &&
           std::none_of(topics.begin(), topics.end(), [&](const RecordedTopic& t) { return t.name == picked; });
  };
  return !topics.empty() && is_indexed(topics) && (missing(options.colour_topic) || missing(options.depth_topic));
}

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

bool RecordingSurvey::shown(const RecordedTopic& topic) const {
  if (is_image(topic.type)) {
    const auto found = shown_images_.find(topic.name);
    return found != shown_images_.end() && (found->second.done || topic.count == 1);
  }
  if (topic.type == "sensor_msgs/CameraInfo") return infos.contains(topic.name);
  if (topic.type == "nav_msgs/Odometry") return odometries.contains(topic.name);
  if (topic.type == "sensor_msgs/Imu") return inertial.contains(topic.name) || without_rates.contains(topic.name);
  if (topic.name == kTransforms) return transform_messages_ >= topic.count.value_or(1);
  return camera_file.has_value();
}

// What has been shown stays so: each topic is passed once.
bool RecordingSurvey::complete(const std::vector<RecordedTopic>& topics, const SourceOptions& options) {
  for (; shown_topics_ < topics.size(); ++shown_topics_) {
    const RecordedTopic& topic = topics[shown_topics_];
    if (is_of_use(topic, options) && topic.count != 0 && !shown(topic)) return false;
  }
  return true;
}

// By an index, and of each topic of images by its first message: then no other kind of image can come.
bool RecordingSurvey::images_known(const std::vector<RecordedTopic>& topics) {
  for (; known_topics_ < topics.size(); ++known_topics_) {
    const RecordedTopic& topic = topics[known_topics_];
    if (!topic.count || (is_image(topic.type) && *topic.count > 0 && !shown_images_.contains(topic.name))) return false;
  }
  return !topics.empty();
}

// A recording may begin at zero. One whose second stamp is zero as well has none.
void RecordingSurvey::take_image(const RecordedTopic& topic, const RecordedMessage& message) {
  const auto known = shown_images_.find(topic.name);
  if (known != shown_images_.end() && known->second.done) return;
  const RecordedImage seen = read_recorded_image(message.bytes, topic.type, topic.encoding, topic.name);
  const bool zero = seen.header.stamp_ns == 0;
  if (known == shown_images_.end()) {
    shown_images_[topic.name] = {images.size(), !zero};
    images.push_back({topic.name, topic.type, seen.encoding, frame_name(seen.header.frame_id), seen.content, seen.width,
                      seen.height, true});
  } else {
    images[known->second.index].stamped = !zero;
    known->second.done = true;
  }
}

void RecordingSurvey::take(const RecordedTopic& topic, const RecordedMessage& message) {
  if (is_image(topic.type)) {
    take_image(topic, message);
  } else if (topic.type == "sensor_msgs/CameraInfo") {
    if (!infos.contains(topic.name)) infos.emplace(topic.name, decode_camera_info(message.bytes, topic.encoding));
  } else if (topic.type == "nav_msgs/Odometry") {
    if (!odometries.contains(topic.name))
      odometries.emplace(topic.name, decode_odometry(message.bytes, topic.encoding).child_frame_id);
  } else if (topic.type == "sensor_msgs/Imu") {
    if (shown(topic)) return;
    const ImuMessage imu = decode_imu(message.bytes, topic.encoding);
    if (imu.angular_velocity_covariance[0] < 0)  // ROS' mark of a unit without a gyroscope
      without_rates.insert(topic.name);
    else
      inertial.emplace(topic.name, imu.header.frame_id);
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
  constexpr size_t kMaxImages = 300, kMaxMessages = 20'000;
  // Without an index topics are known only once they have come.
  constexpr size_t kMinMessages = 100;
  const std::map<std::string, std::string> texts = stream.metadata();
  if (const auto text = texts.find(kCameraText); text != texts.end())
    camera_file = text->second, camera_file_origin = std::string("metadata ") + kCameraText;
  const auto fits = [](const RecordedImageTopic& topic, ImageContent content, const std::string& picked) {
    return picked.empty() ? topic.content == content : topic.name == picked;
  };
  const bool hopeless = is_hopeless(stream.topics(), options);
  bool colour = false, depth = false;
  for (size_t looked_at = 0, further_images = 0, further = 0;;) {
    for (; looked_at < images.size(); ++looked_at) {
      colour = colour || fits(images[looked_at], ImageContent::colour, options.colour_topic);
      depth = depth || fits(images[looked_at], ImageContent::depth, options.depth_topic);
    }
    const bool both = colour && depth;
    const std::vector<RecordedTopic>& topics = stream.topics();
    if (both && complete(topics, options) && (further >= kMinMessages || is_indexed(topics))) return;
    if (!both && images_known(topics)) return;
    if (further_images >= kMaxImages || further >= kMaxMessages) return;
    const std::optional<RecordedMessage> message = stream.next();
    if (!message) return;
    const RecordedTopic& topic = stream.topics()[message->topic];
    const bool rest = both || hopeless;
    further += rest, further_images += rest && is_image(topic.type);
    try {
      take(topic, *message);
    } catch (const InputError& e) {  // perhaps its next one is sound
      if (is_image(topic.type) && first_failure.empty()) first_failure = e.what();
    }
  }
}

}  // namespace dkb
