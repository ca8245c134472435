// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dkb/recordings/recording_contents.h"
#include "dkb/recordings/static_transforms.h"

namespace dkb {

// What the first messages of a recording show, before anything is chosen.
class RecordingSurvey {
 public:
  // Reads from where the stream stands.
  void read(MessageStream& stream, const SourceOptions& options);

  std::vector<RecordedImageTopic> images;          // in the order of their first messages
  std::map<std::string, CameraInfoMessage> infos;  // by topic
  std::map<std::string, std::string> odometries;   // child frame by topic
  std::map<std::string, std::string> inertial;     // frame by topic
  std::set<std::string> without_rates;             // topics of inertial units that tell no angular rates
  StaticTransforms transforms;
  std::optional<std::string> camera_file;  // the text of a camera file that the recording holds
  std::string camera_file_origin;
  std::string first_failure;  // of an image message

 private:
  struct Shown {
    size_t index = 0;  // in `images`
    bool done = true;  // false: its first stamp is zero, and a second one has not come
  };
  void take(const RecordedTopic& topic, const RecordedMessage& message);
  void take_image(const RecordedTopic& topic, const RecordedMessage& message);
  bool complete(const std::vector<RecordedTopic>& topics, const SourceOptions& options);
  bool images_known(const std::vector<RecordedTopic>& topics);
  bool shown(const RecordedTopic& topic) const;

  std::map<std::string, Shown> shown_images_;   // by topic
  size_t shown_topics_ = 0, known_topics_ = 0;  // the stream's first ones, which need not be looked at again
  int64_t transform_messages_ = 0;
};

}  // namespace dkb
