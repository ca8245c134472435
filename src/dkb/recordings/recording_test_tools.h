// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/files.h"
#include "dkb/util/test_folder.h"

namespace dkb::test {

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);  // writing over a file makes some file systems wait for the disk
  std::ofstream(path, std::ios::binary) << bytes;
}

// A message as it was read, with its topic's name.
struct Kept {
  std::string topic;
  int64_t recorded_ns = 0;
  std::string bytes;
  bool operator==(const Kept&) const = default;
};

inline std::vector<Kept> read_all(MessageStream& stream) {
  std::vector<Kept> all;
  while (const auto message = stream.next())
    all.push_back({stream.topics()[message->topic].name, message->recorded_ns, std::string(message->bytes)});
  return all;
}

constexpr int64_t kStart = 1'305'031'102'000'000'007;

// What write_sample() writes: images larger than a chunk, and texts between them.
inline std::vector<Kept> sample(int images, size_t pixels = 1 << 20) {
  std::vector<Kept> all;
  for (int i = 0; i < images; ++i) {
    const int64_t ns = kStart + i * int64_t{33'333'333};
    std::string data(pixels, '\0');
    for (size_t k = 0; k < data.size(); k += 7) data[k] = static_cast<char>(k / 7 + static_cast<size_t>(i));
    ImageMessage image;
    image.header = {ns, "camera"};
    image.height = 1, image.width = image.step = static_cast<uint32_t>(pixels), image.encoding = "mono8";
    image.data = data;
    all.push_back({"/image", ns, encode(image)});
    all.push_back({"/text", ns + 1, encode_string("text " + std::to_string(i))});
  }
  return all;
}

inline void write_sample(const std::filesystem::path& path, const std::vector<Kept>& messages,
                         Compression compression = Compression::none) {
  const auto writer = write_recording(path, compression);
  writer->add_text("note", "a text\n");
  const size_t image = writer->add_topic("/image", "sensor_msgs/Image");
  const size_t text = writer->add_topic("/text", "std_msgs/String", true);
  for (const Kept& m : messages) writer->write(m.topic == "/image" ? image : text, m.recorded_ns, m.bytes);
  writer->close();
}

}  // namespace dkb::test
