// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dkb {

// How the bytes of messages are laid out.
enum class MessageEncoding { ros1, cdr };

// A topic of a recording. `type` without a layer of packages that ROS 2 puts in between: sensor_msgs/Image in both;
// tf/tfMessage goes by its newer name.
struct RecordedTopic {
  std::string name, type;
  MessageEncoding encoding = MessageEncoding::ros1;
  std::optional<int64_t> count;  // of messages, where the recording says so
};

// A message as recorded. `bytes` is valid until the stream is asked for the next one.
struct RecordedMessage {
  size_t topic = 0;         // index into topics()
  int64_t recorded_ns = 0;  // when it was written down; the time of the picture is in the message's header
  std::string_view bytes;
};

// The messages of a recording in recorded order. One thread at a time. What is broken ends the stream or is left out,
// and is told by take_warnings(); memory stays below a few chunks whatever the file claims.
class MessageStream {
 public:
  virtual ~MessageStream() = default;
  // Those seen so far; all of them from the start where the file has an index. Only grows.
  virtual const std::vector<RecordedTopic>& topics() const = 0;
  // Messages of other topics than these names are passed over, their chunks undecoded where the index allows it.
  virtual void select(const std::vector<std::string>& names) = 0;
  virtual std::optional<RecordedMessage> next() = 0;
  virtual void rewind() = 0;
  // Texts kept in the recording beside its messages, by name (metadata records of mcap).
  virtual std::map<std::string, std::string> metadata() const { return {}; }
  // A line each since the last call: a recording that was cut off, a chunk that is broken.
  virtual std::vector<std::string> take_warnings() = 0;
};

// Whether a folder is a rosbag2's, by what lies in it. A sequence in one of the layouts of folders that a recording is
// kept beside stays that sequence.
bool is_rosbag2(const std::filesystem::path& folder);

// FILE.bag (ROS 1, version 2.0), FILE.mcap, FILE.db3 or the folder of a rosbag2, told apart by content. Throws
// InputError when it is none of them.
std::unique_ptr<MessageStream> open_messages(const std::filesystem::path& path);

}  // namespace dkb
