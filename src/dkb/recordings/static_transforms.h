// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include "dkb/recordings/ros_messages.h"
#include "dkb_slam/geometry.h"

namespace dkb {

// Frames that do not move against each other, as /tf_static tells them. Names with and without a slash in front are the
// same.
class StaticTransforms {
 public:
  // The newest word of a frame's parent counts; what is not finite or no rotation is left out.
  void add(const TransformsMessage& transforms);
  // Where frames are linked. A frame is at home in itself; nobody knows where the frame without a name is.
  std::optional<Rigid3> find(const std::string& to, const std::string& from) const;  // to_from_from

 private:
  struct Link {
    std::string parent;
    Rigid3 parent_from_child;
  };
  // The way up to the root: each frame, and ancestor_from_frame.
  std::map<std::string, Rigid3> ancestors(const std::string& frame) const;

  std::map<std::string, Link> parents_;  // by child
};

// Without slashes in front. "0", which librealsense's bags write for every frame, is no name.
std::string frame_name(const std::string& frame_id);

}  // namespace dkb
