// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "parameter_descriptions.h"
#include "types.h"

namespace dkb_ros {

// What a service answers.
struct Answer {
  bool success = false;
  std::string message;
};

// SLAM as a node, without a middleware: messages in by any thread, which is never blocked; results out by Middleware.
class RosCore {
 public:
  virtual ~RosCore() = default;  // waits for the frame in work

  virtual void colour(ImageMessage image) = 0;
  virtual void depth(ImageMessage image) = 0;
  virtual void camera_info(const CameraInfoMessage& info) = 0;
  virtual void odometry(const OdometryMessage& odometry) = 0;
  virtual void imu(const ImuMessage& imu) = 0;
  virtual void initial_pose(const PoseMessage& pose) = 0;

  // Done between two frames, in order; `done` is called on the tracking thread.
  using Done = std::function<void(const Answer&)>;
  virtual void save_map(const std::string& path, Done done) = 0;
  virtual void load_map(const std::string& path, Done done) = 0;
  virtual void reset(Done done) = 0;
  virtual void pause(bool on, Done done) = 0;
  virtual void localize_only(bool on, Done done) = 0;
};

// Parameters by name; those that are not given have their defaults. Throws dkb::InputError for a bad one.
std::unique_ptr<RosCore> make_core(const std::map<std::string, ParameterValue>& parameters, Middleware& middleware);

}  // namespace dkb_ros
