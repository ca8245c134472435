// SPDX-License-Identifier: Apache-2.0
// Messages of every type that is read, and the pixels of images. The first byte tells the encoding.
#include <cstdint>
#include <string_view>

#include "dkb/recordings/recorded_image.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const auto encoding = data[0] % 2 == 0 ? dkb::MessageEncoding::ros1 : dkb::MessageEncoding::cdr;
  const auto attempt = [&](const auto& decode) {
    try {
      decode(bytes, encoding);
    } catch (const dkb::InputError&) {
    }
  };
  attempt(dkb::decode_image), attempt(dkb::decode_compressed_image), attempt(dkb::decode_camera_info);
  attempt(dkb::decode_odometry), attempt(dkb::decode_imu), attempt(dkb::decode_transforms);
  attempt(dkb::decode_string);
  for (const char* type : {"sensor_msgs/Image", "sensor_msgs/CompressedImage"})
    attempt([&](std::string_view message, dkb::MessageEncoding laid_out) {
      const dkb::RecordedImage image = dkb::read_recorded_image(message, type, laid_out, "/image");
      if (image.content == dkb::ImageContent::colour) dkb::picture_of(image);
      if (image.content == dkb::ImageContent::depth) dkb::depth_of(image, dkb::Camera());
    });
  return 0;
}
