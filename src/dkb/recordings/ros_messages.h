// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/recordings/message_reader.h"

namespace dkb {

// The messages that are read and written, with the fields of ROS and under its names. decode_x() takes both encodings
// and throws InputError, without a name, for bytes that end too early; encode() gives the ROS 1 encoding. Numbers are
// handed on as they stand: they may be infinite, and quaternions of any length.

struct HeaderMessage {
  int64_t stamp_ns = 0;
  std::string frame_id;
  uint32_t seq = 0;  // ROS 1 only
};

struct ImageMessage {  // sensor_msgs/Image
  HeaderMessage header;
  uint32_t height = 0, width = 0;
  std::string encoding;
  bool is_bigendian = false;
  uint32_t step = 0;      // [bytes] from a row to the next
  std::string_view data;  // points into the message that it was decoded from
};

struct CompressedImageMessage {  // sensor_msgs/CompressedImage
  HeaderMessage header;
  std::string format;
  std::string_view data;  // likewise
};

struct CameraInfoMessage {  // sensor_msgs/CameraInfo
  HeaderMessage header;
  uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{}, r{};
  std::array<double, 12> p{};
  uint32_t binning_x = 0, binning_y = 0;
  uint32_t roi_x_offset = 0, roi_y_offset = 0, roi_height = 0, roi_width = 0;
  bool roi_do_rectify = false;
};

struct PoseMessage {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

struct OdometryMessage {  // nav_msgs/Odometry
  HeaderMessage header;
  std::string child_frame_id;
  PoseMessage pose;
  std::array<double, 36> pose_covariance{};  // rows of x, y, z, about x, about y, about z
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();
  std::array<double, 36> twist_covariance{};
};

struct ImuMessage {  // sensor_msgs/Imu
  HeaderMessage header;
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero(), linear_acceleration = Eigen::Vector3d::Zero();
  std::array<double, 9> orientation_covariance{}, angular_velocity_covariance{}, linear_acceleration_covariance{};
};

struct TransformMessage {  // geometry_msgs/TransformStamped
  HeaderMessage header;
  std::string child_frame_id;
  PoseMessage transform;  // header.frame_id from child_frame_id
};
using TransformsMessage = std::vector<TransformMessage>;  // tf2_msgs/TFMessage

struct PoseStampedMessage {  // geometry_msgs/PoseStamped
  HeaderMessage header;
  PoseMessage pose;
};

struct PathMessage {  // nav_msgs/Path
  HeaderMessage header;
  std::vector<PoseStampedMessage> poses;
};

struct PointFieldMessage {
  std::string name;
  uint32_t offset = 0;
  uint8_t datatype = 7;  // float32; 2 = uint8, 6 = uint32
  uint32_t count = 1;
};

struct PointCloud2Message {  // sensor_msgs/PointCloud2
  HeaderMessage header;
  uint32_t height = 1, width = 0;
  std::vector<PointFieldMessage> fields;
  bool is_bigendian = false;
  uint32_t point_step = 0, row_step = 0;
  std::string_view data;
  bool is_dense = true;
};

ImageMessage decode_image(std::string_view bytes, MessageEncoding encoding);
CompressedImageMessage decode_compressed_image(std::string_view bytes, MessageEncoding encoding);
CameraInfoMessage decode_camera_info(std::string_view bytes, MessageEncoding encoding);
OdometryMessage decode_odometry(std::string_view bytes, MessageEncoding encoding);
ImuMessage decode_imu(std::string_view bytes, MessageEncoding encoding);
TransformsMessage decode_transforms(std::string_view bytes, MessageEncoding encoding);
std::string decode_string(std::string_view bytes, MessageEncoding encoding);  // std_msgs/String

std::string encode(const ImageMessage& message);
std::string encode(const CompressedImageMessage& message);
std::string encode(const CameraInfoMessage& message);
std::string encode(const OdometryMessage& message);
std::string encode(const ImuMessage& message);
std::string encode(const TransformsMessage& message);
std::string encode(const PoseStampedMessage& message);
std::string encode(const PathMessage& message);
std::string encode(const PointCloud2Message& message);
std::string encode_string(std::string_view text);

// What a recording says of a type that we write.
struct MessageDefinition {
  std::string md5sum;
  std::string text;  // the fields, and those of the types in them
};
bool has_definition(const std::string& type);                   // "sensor_msgs/Image"
MessageDefinition message_definition(const std::string& type);  // of one that has_definition()

}  // namespace dkb
