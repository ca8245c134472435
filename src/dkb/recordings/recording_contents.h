// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/recorded_image.h"
#include "dkb_slam/source.h"

namespace dkb {

// A topic of images, by its first message that is sound.
struct RecordedImageTopic {
  std::string name, type, encoding, frame_id;
  ImageContent content = ImageContent::unknown;
  int width = 0, height = 0;  // [px]
  bool stamped = false;       // not all stamps of its headers are zero
};

// A camera of its own that depth was taken by.
struct SeparateDepthCamera {
  Camera camera;
  Rigid3 colour_from_depth;
};

// Where the motion comes from.
struct RecordedMotionTopic {
  std::string name;
  bool inertial = false;  // sensor_msgs/Imu, else nav_msgs/Odometry
  Rigid3 body_from_cam;
};

// What of a recording makes frames.
struct RecordingContents {
  RecordedImageTopic colour, depth;
  Camera camera;                                    // of the colour images
  std::string camera_origin;                        // for people
  std::optional<SeparateDepthCamera> depth_camera;  // nothing: depth is registered to the colour image
  std::optional<RecordedMotionTopic> motion;
  bool stamped = true;  // false: the time of recording stands in for the headers' stamps
  std::vector<std::string> warnings;
};

// Reads until each topic of images has shown one message and the rest is known, or for a while after one of colour and
// one of depth have; then goes back to the beginning, with the topics selected that are needed. `name` opens the
// messages. Throws InputError where nothing, or more than one, fits and no option picks, where the camera is not known,
// and where depth is neither registered nor can be.
RecordingContents look_into(MessageStream& stream, const SourceOptions& options, const std::string& name);

}  // namespace dkb
