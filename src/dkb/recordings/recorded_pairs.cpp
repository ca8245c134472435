// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_pairs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/odometry_track.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/image/image.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

size_t bytes_of(const StampPairing::Pair& pair) {
  return pair.colour.bytes.size() + pair.depth.bytes.size();
}

// Of the header, which images begin with.
int64_t read_stamp(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  if (encoding == MessageEncoding::ros1) in.u32();  // seq
  return in.stamp_ns();
}

// Why a message of so many bytes holds no image of its topic's size, whatever it says; empty when it may: pixels of any
// encoding and padding fit.
std::string too_large(const RecordedImageTopic& topic, size_t bytes) {
  constexpr size_t kMostPerPixel = 16, kMostElse = 1 << 20;  // [bytes]
  if (bytes <= kMostPerPixel * static_cast<size_t>(topic.width) * static_cast<size_t>(topic.height) + kMostElse)
    return "";
  return topic.name + ": a message of " + std::to_string(bytes >> 20) + " MiB is too large for an image of " +
         std::to_string(topic.width) + "x" + std::to_string(topic.height) + " px";
}

Vector6d diagonal_of(const std::array<double, 36>& covariance) {
  return Eigen::Map<const Matrix6d>(covariance.data()).diagonal();
}

OdometrySample sample_of(const OdometryMessage& message) {
  OdometrySample sample{message.header.stamp_ns, {message.pose.orientation, message.pose.position}};
  sample.twist << message.linear, message.angular;
  sample.pose_variance = diagonal_of(message.pose_covariance);
  sample.twist_variance = diagonal_of(message.twist_covariance);
  return sample;
}

GyroSample sample_of(const ImuMessage& message) {
  const std::array<double, 9>& covariance = message.angular_velocity_covariance;
  return {message.header.stamp_ns, message.angular_velocity, {covariance[0], covariance[4], covariance[8]}};
}

}  // namespace

RecordedImage RecordedPairs::Channel::read(const StampPairing::Stored& message) const {
  RecordedImage image = read_recorded_image(message.bytes, topic.type, encoding, topic.name);
  // Where headers carry no stamps, messages are told by the time that stands in.
  image.name = topic.name + " at " + stamp_text(message.stamp_ns);
  return image;
}

std::string RecordedPairs::Channel::mismatch(const StampPairing::Stored& message) const {
  const RecordedImage image = read(message);
  if (image.content != topic.content)
    return image.name + ": is " + image.encoding + ", other images there are " + topic.encoding;
  std::string wrong = size_mismatch(image.name, image.width, image.height, camera);
  // Whether it is sound in itself tells a wrong camera from a broken message.
  if (!wrong.empty()) topic.content == ImageContent::depth ? void(depth_of(image, camera)) : void(picture_of(image));
  return wrong;
}

std::string RecordedPairs::Decoder::mismatch(const StampPairing::Pair& pair) const {
  return pair_mismatch(
      [&](bool is_depth) { return is_depth ? depth.mismatch(pair.depth) : colour.mismatch(pair.colour); });
}

std::shared_ptr<RgbdImage> RecordedPairs::Decoder::decode(const StampPairing::Pair& pair) const {
  const auto checked = [](const Channel& channel, const StampPairing::Stored& message) {
    RecordedImage image = channel.read(message);
    const std::string wrong = size_change(image.name, image.width, image.height, channel.camera);
    if (image.content == channel.topic.content && !wrong.empty()) throw InputError(wrong);
    return image;
  };
  const RecordedImage colours = checked(colour, pair.colour), depths = checked(depth, pair.depth);
  auto made = std::make_shared<RgbdImage>();
  made->timestamp = seconds_from_ns(pair.colour.stamp_ns);
  made->depth_timestamp = seconds_from_ns(pair.depth.stamp_ns);
  Picture picture = picture_of(colours);
  made->grey = std::move(picture.grey), made->colour = std::move(picture.colour);
  made->depth = depth_of(depths, depth.camera);
  if (registration) made->depth = registration->registered(made->depth);
  leave_out_masked(colour.camera, made->depth);
  return made;
}

RecordedPairs::RecordedPairs(std::unique_ptr<MessageStream> stream, const RecordingContents& contents,
                             const DatasetSelection& selection, std::string name, std::function<void()> go_on)
    : name_(std::move(name)),
      go_on_(std::move(go_on)),
      stream_(std::move(stream)),
      stamped_(contents.stamped),
      motion_topic_(contents.motion),
      decoder_(std::make_shared<Decoder>()),
      filter_(selection),
      warnings_(contents.warnings) {
  decoder_->colour = {contents.colour, MessageEncoding::ros1, contents.camera};
  decoder_->depth = {contents.depth, MessageEncoding::ros1, contents.camera};
  if (contents.depth_camera) {
    decoder_->depth.camera = without_limits(contents.depth_camera->camera);
    decoder_->registration.emplace(contents.depth_camera->camera, contents.camera,
                                   contents.depth_camera->colour_from_depth);
  }
  for (const RecordedTopic& topic : stream_->topics()) {
    if (topic.name == contents.colour.name) decoder_->colour.encoding = topic.encoding;
    if (topic.name == contents.depth.name) decoder_->depth.encoding = topic.encoding;
  }
}

std::optional<StoredPair> RecordedPairs::next() {
  while (!stopped_) {
    if (!ready_.empty() && motion_is_known(ready_.front())) {
      StampPairing::Pair pair = std::move(ready_.front());
      ready_.pop_front();
      ready_bytes_ -= bytes_of(pair);
      return stored(std::move(pair));
    }
    if (ended_) {
      if (filter_.seen() == 0)
        throw InputError(name_ + ": no colour image of " + decoder_->colour.topic.name + " has a depth image of " +
                         decoder_->depth.topic.name + " within " + std::to_string(std::lround(1000 * kPairDifference)) +
                         " ms; both must be of one clock");
      filter_.require_any(name_);
      return std::nullopt;
    }
    go_on_();
    read_message();
  }
  return std::nullopt;
}

void RecordedPairs::read_message() {
  const std::optional<RecordedMessage> message = filter_.done() ? std::nullopt : stream_->next();
  if (!message) {
    ended_ = true;
    if (!filter_.done()) {
      warn_of_clock();
      pairing_.close();
    }
  } else {
    const RecordedTopic& topic = stream_->topics()[message->topic];
    if (topic.name == decoder_->colour.topic.name)
      add_image(StampPairing::colour, topic, *message);
    else if (topic.name == decoder_->depth.topic.name)
      add_image(StampPairing::depth, topic, *message);
    else if (motion_topic_ && topic.name == motion_topic_->name)
      add_motion(topic, *message);
  }
  collect();
  std::vector<std::string> lines = stream_->take_warnings();
  const std::lock_guard lock(mutex_);
  for (std::string& line : lines) warnings_.push_back(std::move(line));
  counts_.unpaired = pairing_.unpaired() + broken_;
}

bool RecordedPairs::is_too_large(const Channel& channel, const RecordedMessage& message) {
  const std::string why = too_large(channel.topic, message.bytes.size());
  if (why.empty()) return false;
  ++broken_;
  warn_once("large", name_ + ": " + why + "; such are left out");
  return true;
}

void RecordedPairs::add_image(StampPairing::Kind kind, const RecordedTopic& topic, const RecordedMessage& message) {
  if (is_too_large(kind == StampPairing::colour ? decoder_->colour : decoder_->depth, message)) return;
  int64_t stamp = message.recorded_ns;
  try {
    if (stamped_) stamp = read_stamp(message.bytes, topic.encoding);
  } catch (const InputError& e) {
    ++broken_;
    warn_once("broken", name_ + ": " + topic.name + ": a message is broken (" + e.what() + "); it is left out");
    return;
  }
  if (!pairing_.add(kind, {stamp, std::string(message.bytes)})) {
    warn_once("late", name_ + ": " + topic.name + ": the stamp " + stamp_text(stamp) +
                          " is not after the one before it; such images are left out");
    const std::lock_guard lock(mutex_);
    ++counts_.late;
  } else if (kind == StampPairing::colour) {
    newest_colour_ns_ = stamp;
  }
}

void RecordedPairs::add_motion(const RecordedTopic& topic, const RecordedMessage& message) {
  bool added = true;
  const auto add = [&](auto sample) {
    if (!stamped_) sample.stamp_ns = message.recorded_ns;
    added = motion_.add(sample);
  };
  try {
    motion_topic_->inertial ? add(sample_of(decode_imu(message.bytes, topic.encoding)))
                            : add(sample_of(decode_odometry(message.bytes, topic.encoding)));
  } catch (const InputError& e) {
    warn_once("motion", name_ + ": " + topic.name + ": a message is broken (" + e.what() + "); it is left out");
  }
  if (!added)
    warn_once("late motion", name_ + ": " + topic.name +
                                 ": a message's stamp is not after the one before it, or its numbers are none; such "
                                 "messages are left out");
}

void RecordedPairs::collect() {
  while (std::optional<StampPairing::Pair> pair = pairing_.take())
    if (filter_.wants(seconds_from_ns(pair->colour.stamp_ns))) {
      ready_bytes_ += bytes_of(*pair);
      ready_.push_back(std::move(*pair));
    }
}

// What tells of the motion may be recorded a little later than the images; not for long are these held back.
bool RecordedPairs::motion_is_known(const StampPairing::Pair& pair) const {
  constexpr int64_t kPatience = kNsPerSecond / 2;
  constexpr size_t kMostReady = 30;
  return !motion_topic_ || ended_ || motion_.reaches(pair.colour.stamp_ns) || ready_.size() > kMostReady ||
         ready_bytes_ > StampPairing::kMaxBytes || *newest_colour_ns_ > pair.colour.stamp_ns + kPatience;
}

StoredPair RecordedPairs::stored(StampPairing::Pair pair) {
  StoredPair made;
  made.stamp_ns = pair.colour.stamp_ns, made.depth_stamp_ns = pair.depth.stamp_ns;
  made.timestamp = seconds_from_ns(made.stamp_ns);
  made.stamp = stamp_text(made.stamp_ns);
  if (motion_topic_) {
    const std::optional<MotionPrior> of_body = before_ns_ ? motion_.between(*before_ns_, made.stamp_ns) : std::nullopt;
    if (of_body) made.prior = moved_to_camera(*of_body, motion_topic_->body_from_cam.inverse());
    if (made.prior && !is_plausible(*made.prior)) made.prior.reset();  // a mount may be any number
    motion_.forget_before(made.stamp_ns);
  }
  before_ns_ = made.stamp_ns;
  const auto images = std::make_shared<const StampPairing::Pair>(std::move(pair));
  made.mismatch = [images, decoder = decoder_] { return decoder->mismatch(*images); };
  made.decode = [images, decoder = decoder_] { return decoder->decode(*images); };
  made.colour_file = [images, decoder = decoder_] { return decoder->colour.read(images->colour).stored; };
  return made;
}

void RecordedPairs::warn_of_clock() {
  if (const int64_t unused = pairing_.behind(); unused > 0)
    warn_once("clock", name_ + ": the clock of its images was set back: the last " + std::to_string(unused) +
                           " of them have stamps before those of pairs that were used, and are left out; split the "
                           "recording there to use them");
}

void RecordedPairs::warn_once(const std::string& kind, const std::string& line) {
  if (std::find(warned_.begin(), warned_.end(), kind) != warned_.end()) return;
  warned_.push_back(kind);
  const std::lock_guard lock(mutex_);
  warnings_.push_back(line);
}

SourceCounts RecordedPairs::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::vector<std::string> RecordedPairs::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
}

}  // namespace dkb
