// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "dkb/dataset/image_codecs.h"
#include "dkb/recordings/ros_messages.h"

namespace dkb {

// What the pixels of a message stand for, by its encoding: 16UC1, mono16, 32FC1 and compressedDepth are depth.
enum class ImageContent { colour, depth, unknown };

// An image message that was read up to its pixels. It points into the bytes of the message.
struct RecordedImage {
  std::string name;  // for messages: topic and stamp
  HeaderMessage header;
  ImageContent content = ImageContent::unknown;
  std::string encoding;       // as the message says
  int width = 0, height = 0;  // [px]; 0 when the content is unknown
  bool compressed = false;
  ImageMessage raw;            // when it is not compressed; its data hold all rows
  std::string_view stored;     // when it is: the image file
  bool inverse_depth = false;  // compressedDepth of floats: depth = quantised[0] / (value - quantised[1])
  float quantised[2] = {};
};

// Reads sensor_msgs/Image or sensor_msgs/CompressedImage, as `type` says; `topic` opens the messages. Throws InputError
// when the message is broken: cut off, of impossible size, rows that are missing.
RecordedImage read_recorded_image(std::string_view bytes, const std::string& type, MessageEncoding encoding,
                                  const std::string& topic);

// The pixels of a colour image; the same for the same pixels, in whatever way they are stored. Throws InputError.
Picture picture_of(const RecordedImage& image);
// Those of a depth image [m]: integers are millimetres. Depth outside of `range`'s limits becomes 0. Throws InputError.
DepthImage depth_of(const RecordedImage& image, const Camera& range);

}  // namespace dkb
