// SPDX-License-Identifier: Apache-2.0
#pragma once

#if __has_include(<tf2_ros/buffer.hpp>)  // of newer releases, where those below warn
#include <tf2_ros/buffer.hpp>
#include <tf2_ros/transform_broadcaster.hpp>
#include <tf2_ros/transform_listener.hpp>
#else
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#endif

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <dkb_slam_ros/msg/movers.hpp>
#include <geometry_msgs/msg/pose_with_covariance_stamped.hpp>
#include <nav_msgs/msg/occupancy_grid.hpp>
#include <nav_msgs/msg/odometry.hpp>
#include <nav_msgs/msg/path.hpp>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/point_cloud2.hpp>
#include <visualization_msgs/msg/marker_array.hpp>

#include "ros_core.h"

namespace dkb_slam_ros {

// ROS 2 around the core: subscribes, publishes and serves. Its callbacks never wait, so any executor will do.
class SlamComponent final : public rclcpp::Node, public dkb_ros::Middleware {
 public:
  // Throws dkb::InputError and rclcpp's exceptions for bad parameters.
  explicit SlamComponent(const rclcpp::NodeOptions& options);
  ~SlamComponent() override;

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
  std::map<std::string, dkb_ros::ParameterValue> declare_all();
  template <class Message, class Callback>
  void subscribe(const std::string& topic, const rclcpp::QoS& qos, Callback callback);
  template <class Service, class Request>
  void serve(const std::string& name, Request request);

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_;
  tf2_ros::TransformBroadcaster tf_sender_;
  rclcpp::Publisher<nav_msgs::msg::Odometry>::SharedPtr odom_;
  rclcpp::Publisher<geometry_msgs::msg::PoseWithCovarianceStamped>::SharedPtr pose_;
  rclcpp::Publisher<nav_msgs::msg::Path>::SharedPtr path_;
  rclcpp::Publisher<sensor_msgs::msg::PointCloud2>::SharedPtr points_;
  rclcpp::Publisher<visualization_msgs::msg::MarkerArray>::SharedPtr markers_;
  rclcpp::Publisher<msg::Movers>::SharedPtr movers_;
  rclcpp::Publisher<sensor_msgs::msg::Image>::SharedPtr features_;
  rclcpp::Publisher<nav_msgs::msg::OccupancyGrid>::SharedPtr grid_;
  rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
  std::unique_ptr<dkb_ros::RosCore> core_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::ServiceBase::SharedPtr> services_;
};

}  // namespace dkb_slam_ros
