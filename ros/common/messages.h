// SPDX-License-Identifier: Apache-2.0
// Between the plain structs and ROS' messages, whose fields have the same names in ROS 1 and 2: what differs (stamps,
// the CameraInfo's letters, the types' namespaces) is in the wrappers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "types.h"

namespace dkb_ros {

template <class Message>
void set_vector(const Eigen::Vector3d& v, Message* m) {
  m->x = v.x(), m->y = v.y(), m->z = v.z();
}

template <class Message>
void set_rotation(const Eigen::Quaterniond& q, Message* m) {
  m->x = q.x(), m->y = q.y(), m->z = q.z(), m->w = q.w();
}

template <class Message>
void set_pose(const Rigid3& pose, Message* m) {
  set_vector(pose.translation, &m->position);
  set_rotation(pose.rotation, &m->orientation);
}

template <class Message>
Rigid3 pose_from(const Message& m) {
  return {Eigen::Quaterniond(m.orientation.w, m.orientation.x, m.orientation.y, m.orientation.z),
          Eigen::Vector3d(m.position.x, m.position.y, m.position.z)};
}

// tf2 takes and multiplies quaternions that are off by up to a hundredth, and the library wants them of length 1.
// Nothing: the quaternion has no direction.
template <class Message>
std::optional<Rigid3> rigid_from_transform(const Message& m) {
  const Eigen::Quaterniond rotation(m.rotation.w, m.rotation.x, m.rotation.y, m.rotation.z);
  const double norm = rotation.norm();
  if (!std::isfinite(norm) || !(norm > 0)) return std::nullopt;
  return Rigid3(rotation.normalized(), Eigen::Vector3d(m.translation.x, m.translation.y, m.translation.z));
}

template <class Array>
void set_covariance(const Matrix6d& covariance, Array* array) {
  for (int i = 0; i < 36; ++i) (*array)[static_cast<size_t>(i)] = covariance(i / 6, i % 6);
}

template <class Array>
Matrix6d covariance_from(const Array& array) {
  Matrix6d m;
  for (int i = 0; i < 36; ++i) m(i / 6, i % 6) = array[static_cast<size_t>(i)];
  return m;
}

// `owner` keeps the message alive.
template <class Message>
ImageMessage image_from(const Message& m, int64_t stamp_ns, std::shared_ptr<const void> owner) {
  ImageMessage image;
  image.stamp_ns = stamp_ns;
  image.frame_id = without_slash(m.header.frame_id);
  image.encoding = m.encoding;
  image.width = static_cast<int>(std::min<uint32_t>(m.width, 1U << 20));
  image.height = static_cast<int>(std::min<uint32_t>(m.height, 1U << 20));
  image.step = m.step;
  image.is_bigendian = m.is_bigendian != 0;
  image.data = m.data.data();
  image.size = m.data.size();
  image.owner = std::move(owner);
  return image;
}

template <class Message>
OdometryMessage odometry_from(const Message& m, int64_t stamp_ns) {
  OdometryMessage odometry;
  odometry.stamp_ns = stamp_ns;
  odometry.child_frame_id = without_slash(m.child_frame_id);
  odometry.pose = pose_from(m.pose.pose);
  odometry.twist << m.twist.twist.linear.x, m.twist.twist.linear.y, m.twist.twist.linear.z, m.twist.twist.angular.x,
      m.twist.twist.angular.y, m.twist.twist.angular.z;
  odometry.twist_covariance = covariance_from(m.twist.covariance);
  odometry.pose_covariance = covariance_from(m.pose.covariance);
  return odometry;
}

template <class Message>
ImuMessage imu_from(const Message& m, int64_t stamp_ns) {
  ImuMessage imu;
  imu.stamp_ns = stamp_ns;
  imu.frame_id = without_slash(m.header.frame_id);
  imu.angular_velocity = {m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z};
  for (int i = 0; i < 9; ++i) imu.covariance(i / 3, i % 3) = m.angular_velocity_covariance[static_cast<size_t>(i)];
  return imu;
}

template <class Message>
PoseMessage pose_with_covariance_from(const Message& m, int64_t stamp_ns) {
  return {stamp_ns, without_slash(m.header.frame_id), pose_from(m.pose.pose), covariance_from(m.pose.covariance)};
}

// Everything but the header's stamp.
template <class Message>
void fill(const TransformOutput& t, Message* m) {
  m->header.frame_id = t.parent;
  m->child_frame_id = t.child;
  set_vector(t.parent_from_child.translation, &m->transform.translation);
  set_rotation(t.parent_from_child.rotation, &m->transform.rotation);
}

template <class Message>
void fill(const OdometryOutput& o, Message* m) {
  m->header.frame_id = o.pose.frame_id;
  m->child_frame_id = o.child_frame_id;
  set_pose(o.pose.pose, &m->pose.pose);
  set_covariance(o.pose.covariance, &m->pose.covariance);
  set_vector(o.twist.head<3>(), &m->twist.twist.linear);
  set_vector(o.twist.tail<3>(), &m->twist.twist.angular);
  set_covariance(o.twist_covariance, &m->twist.covariance);
}

template <class Message>
void fill(const PoseMessage& p, Message* m) {
  m->header.frame_id = p.frame_id;
  set_pose(p.pose, &m->pose.pose);
  set_covariance(p.covariance, &m->pose.covariance);
}

template <class Message>
void fill(const ColourImageOutput& i, Message* m) {
  m->header.frame_id = i.frame_id;
  m->width = static_cast<uint32_t>(i.width);
  m->height = static_cast<uint32_t>(i.height);
  m->encoding = "rgb8";
  m->step = m->width * 3;
  m->data.assign(i.rgb.begin(), i.rgb.end());
}

// Fields x, y, z [m] and rgb, as RViz reads them.
template <class Message>
void fill(const CloudOutput& c, Message* m) {
  m->header.frame_id = c.frame_id;
  m->height = 1;
  m->width = static_cast<uint32_t>(c.points.size());
  m->is_bigendian = false;
  m->is_dense = true;
  m->point_step = 16;
  m->row_step = m->point_step * m->width;
  m->fields.resize(4);
  for (size_t i = 0; i < 4; ++i) {
    m->fields[i].name = std::array<const char*, 4>{"x", "y", "z", "rgb"}[i];
    m->fields[i].offset = static_cast<uint32_t>(4 * i);
    m->fields[i].datatype = 7;  // FLOAT32
    m->fields[i].count = 1;
  }
  m->data.resize(m->row_step);
  uint8_t* to = m->data.data();
  for (const CloudOutput::Point& p : c.points) {
    std::memcpy(to, p.position.data(), 12);
    const uint32_t rgb = uint32_t{p.r} << 16 | uint32_t{p.g} << 8 | p.b;
    std::memcpy(to + 12, &rgb, 4);
    to += 16;
  }
}

template <class Message>
void fill(const GridOutput& g, Message* m) {
  m->header.frame_id = g.frame_id;
  m->info.map_load_time = m->header.stamp;
  m->info.resolution = static_cast<float>(g.cell);
  m->info.width = static_cast<uint32_t>(g.width);
  m->info.height = static_cast<uint32_t>(g.height);
  set_pose(Rigid3(Eigen::Quaterniond::Identity(), {g.origin_x, g.origin_y, g.floor_z}), &m->info.origin);
  m->data.assign(g.cells.begin(), g.cells.end());
}

// Own message: an array `movers`.
template <class Message>
void fill_movers(const MoversOutput& o, Message* m) {
  m->header.frame_id = o.frame_id;
  m->movers.resize(o.movers.size());
  for (size_t i = 0; i < o.movers.size(); ++i) {
    const MoversOutput::Mover& from = o.movers[i];
    auto& to = m->movers[i];
    to.id = static_cast<uint32_t>(from.id);
    to.class_name = from.class_name;
    set_vector(from.position, &to.position);
    set_vector(from.velocity, &to.velocity);
    set_covariance(from.covariance, &to.covariance);
    set_rotation(o.axes, &to.orientation);
    set_vector(from.size, &to.size);
    to.image_x = from.image_x;
    to.image_y = from.image_y;
    to.image_width = from.image_width;
    to.image_height = from.image_height;
  }
}

// A box, an arrow to where the mover will be in a second, and its class; the last message's are taken away first.
template <class MarkerArray>
void fill_markers(const MoversOutput& o, MarkerArray* array) {
  using Marker = typename std::decay_t<decltype(array->markers)>::value_type;
  array->markers.resize(1);
  array->markers[0].header.frame_id = o.frame_id;
  array->markers[0].action = Marker::DELETEALL;
  for (const MoversOutput::Mover& mover : o.movers) {
    Marker box;
    box.header.frame_id = o.frame_id;
    box.ns = "box";
    box.id = mover.id;
    box.type = Marker::CUBE;
    box.action = Marker::ADD;
    set_pose(Rigid3(o.axes, mover.position), &box.pose);
    set_vector(mover.size.cwiseMax(0.01), &box.scale);
    box.color.r = 1, box.color.g = 0.3F, box.color.b = 0.2F, box.color.a = 0.5F;
    Marker arrow = box;
    arrow.ns = "velocity";
    arrow.type = Marker::ARROW;
    set_pose(Rigid3(), &arrow.pose);
    arrow.points.resize(2);
    set_vector(mover.position, &arrow.points[0]);
    set_vector(mover.position + mover.velocity, &arrow.points[1]);
    set_vector({0.04, 0.08, 0}, &arrow.scale);
    arrow.color.a = 1;
    Marker text = box;
    text.ns = "class";
    text.type = Marker::TEXT_VIEW_FACING;
    text.text = mover.class_name + " " + std::to_string(mover.id);
    set_vector({0, 0, 0.15}, &text.scale);
    text.color.a = 1;
    for (Marker* m : {&box, &arrow, &text}) array->markers.push_back(std::move(*m));
  }
}

template <class Message>
void fill(const DiagnosticsOutput& d, const std::string& node, Message* m) {
  m->status.resize(1);
  auto& status = m->status[0];
  status.level = static_cast<std::decay_t<decltype(status.level)>>(d.level);
  status.name = node + ": SLAM";
  status.hardware_id = "dkb-slam";
  status.message = d.message;
  for (const auto& [key, value] : d.values) {
    status.values.emplace_back();
    status.values.back().key = key;
    status.values.back().value = value;
  }
}

}  // namespace dkb_ros
