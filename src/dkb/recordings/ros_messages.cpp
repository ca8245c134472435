// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/ros_messages.h"

#include "dkb/map/byte_stream.h"

namespace dkb {
namespace {

HeaderMessage read_header(MessageReader& in) {
  HeaderMessage header;
  if (in.encoding() == MessageEncoding::ros1) header.seq = in.u32();
  header.stamp_ns = in.stamp_ns();
  header.frame_id = in.text();
  return header;
}

Eigen::Vector3d read_vector(MessageReader& in) {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = in.f64();
  return v;
}

Eigen::Quaterniond read_quaternion(MessageReader& in) {
  Eigen::Quaterniond q;
  for (int i = 0; i < 4; ++i) q.coeffs()[i] = in.f64();  // x, y, z, w
  return q;
}

PoseMessage read_pose(MessageReader& in) {
  PoseMessage pose;
  pose.position = read_vector(in);
  pose.orientation = read_quaternion(in);
  return pose;
}

void write_text(ByteWriter& out, std::string_view text) {
  out.u32(static_cast<uint32_t>(text.size()));
  out.raw(text);
}

void write_header(ByteWriter& out, const HeaderMessage& header) {
  out.u32(header.seq);
  out.u32(static_cast<uint32_t>(header.stamp_ns / 1'000'000'000));
  out.u32(static_cast<uint32_t>(header.stamp_ns % 1'000'000'000));
  write_text(out, header.frame_id);
}

template <class Numbers>
void write_f64s(ByteWriter& out, const Numbers& numbers) {
  for (const double number : numbers) out.f64(number);
}

void write_vector(ByteWriter& out, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) out.f64(v[i]);
}

void write_quaternion(ByteWriter& out, const Eigen::Quaterniond& q) {
  for (int i = 0; i < 4; ++i) out.f64(q.coeffs()[i]);
}

void write_pose(ByteWriter& out, const PoseMessage& pose) {
  write_vector(out, pose.position);
  write_quaternion(out, pose.orientation);
}

void write_pose_stamped(ByteWriter& out, const PoseStampedMessage& pose) {
  write_header(out, pose.header);
  write_pose(out, pose.pose);
}

}  // namespace

ImageMessage decode_image(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  ImageMessage image;
  image.header = read_header(in);
  image.height = in.u32(), image.width = in.u32();
  image.encoding = in.text();
  image.is_bigendian = in.boolean();
  image.step = in.u32();
  image.data = in.bytes();
  return image;
}

CompressedImageMessage decode_compressed_image(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  CompressedImageMessage image;
  image.header = read_header(in);
  image.format = in.text();
  image.data = in.bytes();
  return image;
}

CameraInfoMessage decode_camera_info(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  CameraInfoMessage info;
  info.header = read_header(in);
  info.height = in.u32(), info.width = in.u32();
  info.distortion_model = in.text();
  info.d.resize(in.count(sizeof(double)));
  in.f64s(&info.d), in.f64s(&info.k), in.f64s(&info.r), in.f64s(&info.p);
  info.binning_x = in.u32(), info.binning_y = in.u32();
  info.roi_x_offset = in.u32(), info.roi_y_offset = in.u32();
  info.roi_height = in.u32(), info.roi_width = in.u32();
  info.roi_do_rectify = in.boolean();
  return info;
}

OdometryMessage decode_odometry(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  OdometryMessage odometry;
  odometry.header = read_header(in);
  odometry.child_frame_id = in.text();
  odometry.pose = read_pose(in);
  in.f64s(&odometry.pose_covariance);
  odometry.linear = read_vector(in), odometry.angular = read_vector(in);
  in.f64s(&odometry.twist_covariance);
  return odometry;
}

ImuMessage decode_imu(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  ImuMessage imu;
  imu.header = read_header(in);
  imu.orientation = read_quaternion(in);
  in.f64s(&imu.orientation_covariance);
  imu.angular_velocity = read_vector(in);
  in.f64s(&imu.angular_velocity_covariance);
  imu.linear_acceleration = read_vector(in);
  in.f64s(&imu.linear_acceleration_covariance);
  return imu;
}

TransformsMessage decode_transforms(std::string_view bytes, MessageEncoding encoding) {
  MessageReader in(bytes, encoding);
  TransformsMessage transforms(in.count(8 + 4 + 4 + 7 * sizeof(double)));
  for (TransformMessage& transform : transforms) {
    transform.header = read_header(in);
    transform.child_frame_id = in.text();
    transform.transform = read_pose(in);
  }
  return transforms;
}

std::string decode_string(std::string_view bytes, MessageEncoding encoding) {
  return std::string(MessageReader(bytes, encoding).text());
}

std::string encode(const ImageMessage& message) {
  ByteWriter out;
  out.reserve(message.data.size() + 100);
  write_header(out, message.header);
  out.u32(message.height), out.u32(message.width);
  write_text(out, message.encoding);
  out.u8(message.is_bigendian);
  out.u32(message.step);
  write_text(out, message.data);
  return out.take();
}

std::string encode(const CompressedImageMessage& message) {
  ByteWriter out;
  out.reserve(message.data.size() + 100);
  write_header(out, message.header);
  write_text(out, message.format);
  write_text(out, message.data);
  return out.take();
}

std::string encode(const CameraInfoMessage& message) {
  ByteWriter out;
  write_header(out, message.header);
  out.u32(message.height), out.u32(message.width);
  write_text(out, message.distortion_model);
  out.u32(static_cast<uint32_t>(message.d.size()));
  write_f64s(out, message.d), write_f64s(out, message.k), write_f64s(out, message.r), write_f64s(out, message.p);
  out.u32(message.binning_x), out.u32(message.binning_y);
  out.u32(message.roi_x_offset), out.u32(message.roi_y_offset);
  out.u32(message.roi_height), out.u32(message.roi_width);
  out.u8(message.roi_do_rectify);
  return out.take();
}

std::string encode(const OdometryMessage& message) {
  ByteWriter out;
  write_header(out, message.header);
  write_text(out, message.child_frame_id);
  write_pose(out, message.pose);
  write_f64s(out, message.pose_covariance);
  write_vector(out, message.linear), write_vector(out, message.angular);
  write_f64s(out, message.twist_covariance);
  return out.take();
}

std::string encode(const ImuMessage& message) {
  ByteWriter out;
  write_header(out, message.header);
  write_quaternion(out, message.orientation);
  write_f64s(out, message.orientation_covariance);
  write_vector(out, message.angular_velocity);
  write_f64s(out, message.angular_velocity_covariance);
  write_vector(out, message.linear_acceleration);
  write_f64s(out, message.linear_acceleration_covariance);
  return out.take();
}

std::string encode(const TransformsMessage& message) {
  ByteWriter out;
  out.u32(static_cast<uint32_t>(message.size()));
  for (const TransformMessage& transform : message) {
    write_header(out, transform.header);
    write_text(out, transform.child_frame_id);
    write_pose(out, transform.transform);
  }
  return out.take();
}

std::string encode(const PoseStampedMessage& message) {
  ByteWriter out;
  write_pose_stamped(out, message);
  return out.take();
}

std::string encode(const PathMessage& message) {
  ByteWriter out;
  write_header(out, message.header);
  out.u32(static_cast<uint32_t>(message.poses.size()));
  for (const PoseStampedMessage& pose : message.poses) write_pose_stamped(out, pose);
  return out.take();
}

std::string encode(const PointCloud2Message& message) {
  ByteWriter out;
  out.reserve(message.data.size() + 500);
  write_header(out, message.header);
  out.u32(message.height), out.u32(message.width);
  out.u32(static_cast<uint32_t>(message.fields.size()));
  for (const PointFieldMessage& field : message.fields) {
    write_text(out, field.name);
    out.u32(field.offset);
    out.u8(field.datatype);
    out.u32(field.count);
  }
  out.u8(message.is_bigendian);
  out.u32(message.point_step), out.u32(message.row_step);
  write_text(out, message.data);
  out.u8(message.is_dense);
  return out.take();
}

std::string encode_string(std::string_view text) {
  ByteWriter out;
  write_text(out, text);
  return out.take();
}

}  // namespace dkb
