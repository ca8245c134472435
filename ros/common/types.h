// SPDX-License-Identifier: Apache-2.0
// What goes between the core and a middleware: messages as plain structs, so that the core knows neither ROS. C++17 at
// most, here and in ros_core.h and messages.h: message headers of ROS 1 do not compile as C++20.
// Stamps are nanoseconds. Frames follow REP 103 and REP 105: x forward, y left, z up; `map` -> `odom` -> base.
#pragma once

#include <dkb_slam/errors.h>
#include <dkb_slam/geometry.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace dkb_ros {

using dkb::Matrix6d;
using dkb::Rigid3;
using dkb::Vector6d;

// ROS 1 has frames with a leading slash in old descriptions of robots; TF refuses to look one up.
inline std::string without_slash(const std::string& frame_id) {
  return frame_id.substr(std::min(frame_id.find_first_not_of('/'), frame_id.size()));
}

// An image as it came; `owner` keeps the pixels alive, so that nothing is copied on the thread that received it.
struct ImageMessage {
  int64_t stamp_ns = 0;
  std::string frame_id, encoding;
  int width = 0, height = 0;
  size_t step = 0;  // [bytes] from a row to the next
  bool is_bigendian = false;
  const uint8_t* data = nullptr;
  size_t size = 0;  // [bytes]
  std::shared_ptr<const void> owner;
  int64_t arrived_ns = 0;  // by the steady clock, set by the core
};

struct CameraInfoMessage {
  int width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
  std::array<double, 12> p{};
};

struct OdometryMessage {
  int64_t stamp_ns = 0;
  std::string child_frame_id;
  Rigid3 pose;                                   // of the child frame in a frame that stands still
  Vector6d twist = Vector6d::Zero();             // [v m/s, w rad/s] in the child frame
  Matrix6d twist_covariance = Matrix6d::Zero();  // of `twist`; zero = unknown
  Matrix6d pose_covariance = Matrix6d::Zero();   // of `pose`, in the axes of the frame that stands still; likewise
};

struct ImuMessage {
  int64_t stamp_ns = 0;
  std::string frame_id;
  Eigen::Vector3d angular_velocity{0, 0, 0};             // [rad/s]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of it; zero = unknown, (0, 0) below 0 = there is none
};

// A pose of the base in a frame. The covariance is as ROS wants it: x, y, z, then rotation about the fixed axes.
struct PoseMessage {
  int64_t stamp_ns = 0;
  std::string frame_id;
  Rigid3 pose;
  Matrix6d covariance = Matrix6d::Zero();
};

struct OdometryOutput {
  PoseMessage pose;
  std::string child_frame_id;
  Vector6d twist = Vector6d::Zero();  // [v m/s, w rad/s] in the child frame
  Matrix6d twist_covariance = Matrix6d::Zero();
};

struct TransformOutput {
  int64_t stamp_ns = 0;
  std::string parent, child;
  Rigid3 parent_from_child;
};

struct MoversOutput {
  int64_t stamp_ns = 0;
  std::string frame_id;
  Eigen::Quaterniond axes = Eigen::Quaterniond::Identity();  // of the sizes: the camera's axes in that frame
  struct Mover {
    int id = 0;
    std::string class_name;
    Eigen::Vector3d position{0, 0, 0}, velocity{0, 0, 0}, size{0, 0, 0};  // [m], [m/s], [m]
    Matrix6d covariance = Matrix6d::Zero();                               // of [position, velocity]
    float image_x = 0, image_y = 0, image_width = 0, image_height = 0;    // [px] its box
  };
  std::vector<Mover> movers;
};

struct CloudOutput {
  int64_t stamp_ns = 0;
  std::string frame_id;
  struct Point {
    Eigen::Vector3f position{0, 0, 0};  // [m]
    uint8_t r = 0, g = 0, b = 0;
  };
  std::vector<Point> points;
};

struct PathOutput {
  int64_t stamp_ns = 0;
  std::string frame_id;
  struct Pose {
    int64_t stamp_ns = 0;
    Rigid3 pose;
  };
  std::vector<Pose> poses;
};

// Cells row by row from the lower left corner, x first: -1 unknown, 0 free, 100 occupied.
struct GridOutput {
  int64_t stamp_ns = 0;
  std::string frame_id;
  double cell = 0.05;                              // [m]
  int width = 0, height = 0;                       // [cells]
  double origin_x = 0, origin_y = 0, floor_z = 0;  // [m] of the lower left corner, axes as the frame's
  std::vector<int8_t> cells;
};

struct ColourImageOutput {
  int64_t stamp_ns = 0;
  std::string frame_id;
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // rows are packed
};

struct DiagnosticsOutput {
  enum Level : uint8_t { ok = 0, warning = 1, error = 2 };
  int64_t stamp_ns = 0;
  Level level = ok;
  std::string message;
  std::vector<std::pair<std::string, std::string>> values;
};

enum class LogLevel { info, warning, error };
enum class Topic { odom, pose, path, map_points, movers, movers_array, features_image, grid };

// What the core needs of a middleware. Called from the core's threads, more than one at a time.
class Middleware {
 public:
  virtual ~Middleware() = default;

  virtual void log(LogLevel level, const std::string& text) = 0;
  virtual bool wanted(Topic topic) = 0;  // somebody listens
  virtual int64_t now_ns() = 0;          // the middleware's clock, which may be simulated
  // target_from_source at a time, or the newest. Never waits.
  virtual std::optional<Rigid3> transform(const std::string& target, const std::string& source,
                                          std::optional<int64_t> stamp_ns) = 0;

  virtual void publish(const std::vector<TransformOutput>& transforms) = 0;
  virtual void publish(const OdometryOutput& odometry) = 0;
  virtual void publish(const PoseMessage& pose) = 0;
  virtual void publish(const PathOutput& path) = 0;
  virtual void publish(const CloudOutput& points) = 0;
  virtual void publish(const MoversOutput& movers) = 0;
  virtual void publish(const ColourImageOutput& features) = 0;
  virtual void publish(const GridOutput& grid) = 0;
  virtual void publish(const DiagnosticsOutput& diagnostics) = 0;
};

}  // namespace dkb_ros
