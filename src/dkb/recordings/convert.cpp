// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/convert.h"

#include <set>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/pair_writer.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
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

// Whether a reader that pairs by stamps finds these pairs again.
bool pairs_by_stamps(const std::vector<DatasetPair>& pairs) {
  std::vector<double> colour, depth;
  for (const DatasetPair& pair : pairs) {
    if (!depth.empty() && pair.depth_timestamp <= depth.back()) return false;
    colour.push_back(pair.timestamp), depth.push_back(pair.depth_timestamp);
  }
  const std::vector<std::pair<size_t, size_t>> found = associate(colour, depth, {});
  if (found.size() != pairs.size()) return false;
  return std::all_of(found.begin(), found.end(), [](const auto& pair) { return pair.first == pair.second; });
}

Converted convert_folder(const fs::path& in, const fs::path& out, const ConvertOptions& options) {
  const TumDataset dataset = open_tum_dataset(in);
  const Camera camera = choose_camera(options.source.camera, in).camera;
  const std::string text = camera_text(camera, options.source.camera, in);
  const bool own_stamps = !is_recording_name(out) || pairs_by_stamps(dataset.pairs);
  if (!own_stamps)
    options.warn((in / dataset.list).string() +
                 ": by their stamps alone these images would be paired otherwise; depth images get the stamps of their "
                 "colour images");
  const auto writer = write_pairs(out, camera, text, {.compression = options.compression});
  Converted converted{0, "pairs"};
  for (const DatasetPair& pair : dataset.pairs) {
    try {
      const std::string colour = read_file(pair.colour_path);
      const Picture picture = decode_picture(colour, pair.colour_path.string());
      const DepthImage depth = read_depth(pair.depth_path, without_limits(camera));
      PairToWrite write{pair.stamp_ns, own_stamps ? pair.depth_stamp_ns : pair.stamp_ns, colour, &picture, &depth};
      if (options.raw) write.colour_file = {};
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

// A message in the ROS 1 encoding; nothing for types that are not known here.
std::optional<std::string> as_ros1(const std::string& type, MessageEncoding encoding, std::string_view bytes) {
  if (!has_definition(type)) return std::nullopt;
  if (encoding == MessageEncoding::ros1) return std::string(bytes);
  if (type == "sensor_msgs/Image") return encode(decode_image(bytes, encoding));
  if (type == "sensor_msgs/CompressedImage") return encode(decode_compressed_image(bytes, encoding));
  if (type == "sensor_msgs/CameraInfo") return encode(decode_camera_info(bytes, encoding));
  if (type == "sensor_msgs/Imu") return encode(decode_imu(bytes, encoding));
  if (type == "nav_msgs/Odometry") return encode(decode_odometry(bytes, encoding));
  if (type == "tf2_msgs/TFMessage") return encode(decode_transforms(bytes, encoding));
  if (type == "std_msgs/String") return encode_string(decode_string(bytes, encoding));
  return std::nullopt;
}

// The camera file that goes along: the user's, else the recording's own; empty when there is none.
std::string camera_text_of(MessageStream& stream, const ConvertOptions& options) {
  if (!options.source.camera.empty())
    return camera_text(choose_camera(options.source.camera, {}).camera, options.source.camera, {});
  const auto texts = stream.metadata();
  if (const auto found = texts.find(kCameraText); found != texts.end()) return found->second;
  stream.select({kCameraTopic});
  std::string text;
  if (const auto message = stream.next()) {
    const RecordedTopic& topic = stream.topics()[message->topic];
    if (topic.type == "std_msgs/String") text = decode_string(message->bytes, topic.encoding);
  }
  return text;
}

Converted convert_messages(MessageStream& stream, const fs::path& in, const fs::path& out,
                           const ConvertOptions& options) {
  const std::string camera = camera_text_of(stream, options);
  const auto writer = write_recording(out, options.compression);
  std::vector<std::optional<size_t>> topics;  // by the stream's
  const auto add_topics = [&] {
    std::vector<std::string> names;
    for (size_t i = topics.size(); i < stream.topics().size(); ++i) {
      const RecordedTopic& topic = stream.topics()[i];
      const bool latched = topic.name == "/tf_static";
      const bool replaced = topic.name == kCameraTopic && !camera.empty();
      topics.emplace_back();
      if (replaced) continue;
      if (has_definition(topic.type))
        topics.back() = writer->add_topic(topic.name, topic.type, latched);
      else
        options.warn(in.string() + ": topic " + topic.name + " of type " + topic.type +
                     " is left out; its type is not known");
    }
  };
  if (!camera.empty()) writer->add_text(kCameraText, camera);
  std::optional<size_t> camera_topic;
  if (!camera.empty()) camera_topic = writer->add_topic(kCameraTopic, "std_msgs/String", true);

  stream.rewind();
  Converted converted{0, "messages"};
  while (const auto message = stream.next()) {
    if (camera_topic) writer->write(*camera_topic, message->recorded_ns, encode_string(camera));
    camera_topic.reset();
    add_topics();
    if (!topics[message->topic]) continue;
    const RecordedTopic& topic = stream.topics()[message->topic];
    try {
      const auto bytes = as_ros1(topic.type, topic.encoding, message->bytes);
      if (!bytes) continue;
      writer->write(*topics[message->topic], message->recorded_ns, *bytes);
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

}  // namespace

Converted convert(const fs::path& in, const fs::path& out, const ConvertOptions& options) {
  std::error_code error;
  if (!fs::exists(in, error)) throw InputError(in.string() + ": no such file or folder");
  const bool folder =
      fs::is_directory(in, error) && (fs::exists(in / "associations.txt", error) || fs::exists(in / "rgb.txt", error));
  if (folder) return convert_folder(in, out, options);
  const auto stream = open_messages(in);
  return convert_messages(*stream, in, out, options);
}

}  // namespace dkb
