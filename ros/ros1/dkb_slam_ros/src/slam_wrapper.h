// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <dkb_slam_ros/MapFile.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <optional>

#include "ros_core.h"

namespace dkb_slam_ros {

// ROS 1 around the core: subscribes, publishes and serves, on threads of its own.
class SlamWrapper final : public dkb_ros::Middleware {
 public:
  // Throws dkb::InputError for a bad parameter.
  SlamWrapper(ros::NodeHandle nh, ros::NodeHandle private_nh);
  ~SlamWrapper() override;

  void log(dkb_ros::LogLevel level, const std::string& text) override;
  bool wanted(dkb_ros::Topic topic) override;
  int64_t now_ns() override;
  std::optional<dkb_ros::Rigid3> transform(const std::string& target, const std::string& source,
                                           std::optional<int64_t> stamp_ns) override;
  void publish(const std::vector<dkb_ros::TransformOutput>& transforms) override;
  void publish(const dkb_ros::OdometryOutput& odometry) override;
  void publish(const dkb_ros::PoseMessage& pose) override;
  void publish(const dkb_ros::PathOutput& path) override;
  void publish(const dkb_ros::CloudOutput& points) override;
  void publish(const dkb_ros::MoversOutput& movers) override;
  void publish(const dkb_ros::ColourImageOutput& features) override;
  void publish(const dkb_ros::GridOutput& grid) override;
  void publish(const dkb_ros::DiagnosticsOutput& diagnostics) override;

 private:
  template <class Message, class Callback>
  void subscribe(ros::NodeHandle& nh, const std::string& topic, uint32_t queue, Callback callback);
  template <class Service, class Request>
  void serve(ros::NodeHandle& nh, const std::string& name, Request request);

  std::string name_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  tf2_ros::TransformBroadcaster tf_sender_;
  ros::Publisher odom_, pose_, path_, points_, markers_, movers_, features_, grid_, diagnostics_;
  std::unique_ptr<dkb_ros::RosCore> core_;
  ros::CallbackQueue input_queue_, service_queue_;  // a service may take a while, images must not wait for it
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::ServiceServer> services_;
  ros::AsyncSpinner input_spinner_{1, &input_queue_}, service_spinner_{1, &service_queue_};
};

}  // namespace dkb_slam_ros
