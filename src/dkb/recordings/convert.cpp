// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/convert.h"

#include <memory>
#include <optional>
#include <utility>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/folder_source.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/pair_writer.h"
#include "dkb/recordings/recorded_pairs.h"
#include "dkb/recordings/recording_contents.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/recordings/topic_names.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

// The camera file itself where there is one, comments and all.
std::string camera_text(const Camera& camera, const std::string& option, const fs::path& folder) {
  std::error_code error;
  const fs::path file = option.empty() ? folder / "camera.yaml" : fs::path(option);
  return fs::is_regular_file(file, error) ? read_file(file) : camera.to_yaml();
}

Converted convert_folder(const fs::path& in, const fs::path& out, const ConvertOptions& options) {
  const FolderLayout layout = open_folder_layout(in);
  const TumDataset& dataset = layout.dataset;
  const CameraChoice choice = choose_folder_camera(in, layout, options.source);
  if (!choice.doubt.empty()) options.warn(choice.doubt);
  const Camera& camera = choice.camera;
  const std::string text = camera_text(camera, options.source.camera, in);
  const auto writer = write_pairs(out, camera, text, {.compression = options.compression, .warn = options.warn});
  Converted converted{0, "pairs"};
  for (const DatasetPair& pair : dataset.pairs) {
    options.go_on();
    try {
      const std::string colour = read_file(pair.colour_path);
      Picture picture = decode_picture(colour, pair.colour_path.string());
      if (layout.fit_colour) picture = resampled(picture, camera.width, camera.height);
      const DepthImage depth = read_depth(pair.depth_path, without_limits(camera));
      PairToWrite write{pair.stamp_ns, pair.depth_stamp_ns, colour, &picture, &depth};
      if (options.raw || layout.fit_colour) write.colour_file = {};
      writer->add(write);
      ++converted.count;
    } catch (const OutputError&) {
      throw;
    } catch (const InputError& e) {
      options.warn(std::string(e.what()) + "; this pair is left out");
    }
  }
  if (converted.count == 0) throw InputError(in.string() + ": none of its pairs can be read");
  writer->close();
  return converted;
}

// Brings messages into the ROS 1 encoding.
using ToRos1 = std::string (*)(std::string_view bytes, MessageEncoding encoding);

template <auto decode>
std::string encoded_anew(std::string_view bytes, MessageEncoding encoding) {
  return encode(decode(bytes, encoding));
}

// Null where messages of this kind cannot be brought into it.
ToRos1 to_ros1(const RecordedTopic& topic) {
  if (!has_definition(topic.type)) return nullptr;
  if (topic.encoding == MessageEncoding::ros1)
    return [](std::string_view bytes, MessageEncoding) { return std::string(bytes); };
  static const std::map<std::string, ToRos1> known = {
      {"sensor_msgs/Image", encoded_anew<decode_image>},
      {"sensor_msgs/CompressedImage", encoded_anew<decode_compressed_image>},
      {"sensor_msgs/CameraInfo", encoded_anew<decode_camera_info>},
      {"sensor_msgs/Imu", encoded_anew<decode_imu>},
      {"nav_msgs/Odometry", encoded_anew<decode_odometry>},
      {"tf2_msgs/TFMessage", encoded_anew<decode_transforms>},
      {"std_msgs/String",
       [](std::string_view bytes, MessageEncoding encoding) { return encode_string(decode_string(bytes, encoding)); }}};
  const auto found = known.find(topic.type);
  return found == known.end() ? nullptr : found->second;
}

// The camera file that goes along: the user's, else the recording's own; empty when there is none.
std::string camera_text_of(const fs::path& in, const ConvertOptions& options) {
  if (!options.source.camera.empty())
    return camera_text(choose_camera(options.source.camera, {}).camera, options.source.camera, {});
  const auto stream = open_messages(in);
  const auto texts = stream->metadata();
  if (const auto found = texts.find(kCameraText); found != texts.end()) return found->second;
  stream->select({kCameraTopic});
  std::string text;
  if (const auto message = stream->next()) {
    const RecordedTopic& topic = stream->topics()[message->topic];
    if (topic.type == "std_msgs/String") text = decode_string(message->bytes, topic.encoding);
  }
  return text;
}

Converted convert_messages(MessageStream& stream, const fs::path& in, const fs::path& out,
                           const ConvertOptions& options) {
  const std::string camera = camera_text_of(in, options);
  const auto writer = write_recording(out, options.compression);
  struct Written {
    size_t topic = 0;
    ToRos1 to_ros1 = nullptr;  // null: it is left out
  };
  std::vector<Written> topics;  // by the stream's
  const auto add_topics = [&] {
    std::vector<std::string> names;
    for (size_t i = topics.size(); i < stream.topics().size(); ++i) {
      const RecordedTopic& topic = stream.topics()[i];
      const bool latched = topic.name == kTransforms;
      const bool replaced = topic.name == kCameraTopic && !camera.empty();
      topics.emplace_back();
      if (replaced) continue;
      topics.back().to_ros1 = to_ros1(topic);
      if (topics.back().to_ros1 != nullptr)
        topics.back().topic = writer->add_topic(topic.name, topic.type, latched);
      else
        options.warn(in.string() + ": topic " + topic.name + " of type " + topic.type + " is left out; its type is " +
                     (has_definition(topic.type) ? "not converted from ROS 2" : "not known"));
    }
  };
  if (!camera.empty()) writer->add_text(kCameraText, camera);
  bool camera_due = !camera.empty();  // at the time of the first message
  const size_t camera_topic = camera_due ? writer->add_topic(kCameraTopic, "std_msgs/String", true) : 0;

  Converted converted{0, "messages"};
  while (const auto message = stream.next()) {
    options.go_on();
    if (std::exchange(camera_due, false)) writer->write(camera_topic, message->recorded_ns, encode_string(camera));
    add_topics();
    const Written& written = topics[message->topic];
    if (written.to_ros1 == nullptr) continue;
    const RecordedTopic& topic = stream.topics()[message->topic];
    try {
      writer->write(written.topic, message->recorded_ns, written.to_ros1(message->bytes, topic.encoding));
      ++converted.count;
    } catch (const OutputError&) {
      throw;
    } catch (const InputError& e) {
      options.warn(in.string() + ": a message of " + topic.name + " is broken (" + e.what() + ") and left out");
    }
  }
  for (const std::string& line : stream.take_warnings()) options.warn(line);
  if (converted.count == 0) throw InputError(in.string() + ": holds no message of a type that is known here");
  writer->close();
  return converted;
}

Converted convert_to_folder(std::unique_ptr<MessageStream> stream, const fs::path& in, const fs::path& out,
                            const ConvertOptions& options) {
  std::string text = camera_text_of(in, options);
  SourceOptions reading = options.source;
  reading.prior = PriorKind::none;  // a folder has no room for motion
  RecordingContents contents = look_into(*stream, reading, in.string());
  if (text.empty()) {
    if (contents.depth.encoding != "32FC1") contents.camera.depth_factor = kMillimetres;  // as the integers are stored
    text = contents.camera.to_yaml();
  }
  const auto writer = write_pairs(out, contents.camera, text);
  contents.camera = without_limits(contents.camera);
  RecordedPairs pairs(std::move(stream), contents, {}, in.string(), options.go_on);
  const auto warn = [&] {
    for (const std::string& line : pairs.take_warnings()) options.warn(line);
  };
  Converted converted{0, "pairs"};
  while (const auto pair = pairs.next()) {
    warn();
    try {
      if (const std::string wrong = pair->mismatch(); !wrong.empty()) throw InputError(wrong);
      const auto image = pair->decode();
      const Picture picture{std::move(image->grey), std::move(image->colour)};
      writer->add({pair->stamp_ns, pair->depth_stamp_ns, pair->colour_file(), &picture, &image->depth});
      ++converted.count;
    } catch (const OutputError&) {
      throw;
    } catch (const InputError& e) {
      options.warn(std::string(e.what()) + "; it is left out");
    }
  }
  warn();
  const auto tell_lost = [&](int64_t count, const std::string& why) {
    if (count > 0) options.warn(std::to_string(count) + " images " + why + " are left out");
  };
  tell_lost(pairs.counts().late, "whose stamps do not rise");
  tell_lost(pairs.counts().unpaired, "that are broken or have no partner of their time");
  if (converted.count == 0) throw InputError(in.string() + ": none of its images can be paired and read");
  writer->close();
  return converted;
}

}  // namespace

Converted convert(const fs::path& in, const fs::path& out, const ConvertOptions& options) {
  std::error_code error;
  if (!fs::exists(in, error)) throw InputError(in.string() + ": no such file or folder");
  if (fs::is_directory(in, error) && !is_rosbag2(in)) return convert_folder(in, out, options);
  if (in.extension() == ".oni")
    throw InputError(in.string() + ": is a recording of OpenNI, not of ROS messages; `dkb-slam record " + in.string() +
                     " --out " + out.string() + "` converts it");
  auto stream = open_messages(in);
  return is_recording_name(out) ? convert_messages(*stream, in, out, options)
                                : convert_to_folder(std::move(stream), in, out, options);
}

}  // namespace dkb
