// SPDX-License-Identifier: Apache-2.0
#include "slam_component.h"

#include <algorithm>
#include <cmath>
#include <dkb_slam_ros/srv/map_file.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/imu.hpp>
#include <std_srvs/srv/set_bool.hpp>
#include <std_srvs/srv/trigger.hpp>

#include "messages.h"

namespace dkb_slam_ros {
namespace {

using dkb_ros::Rigid3;
using dkb_ros::RosCore;
using dkb_ros::Topic;

int64_t ns_of(const builtin_interfaces::msg::Time& time) {
  return int64_t{time.sec} * 1'000'000'000 + time.nanosec;
}

template <class Message>
Message stamped(int64_t stamp_ns) {
  Message m;
  m.header.stamp = rclcpp::Time(std::max<int64_t>(stamp_ns, 0));
  return m;
}

rcl_interfaces::msg::ParameterDescriptor descriptor_of(const dkb_ros::ParameterDescription& d) {
  rcl_interfaces::msg::ParameterDescriptor descriptor;
  descriptor.description = d.meaning;
  descriptor.read_only = true;
  for (const std::string& choice : d.choices)
    descriptor.additional_constraints += (descriptor.additional_constraints.empty() ? "one of " : ", ") + choice;
  if (!std::isfinite(d.min) && !std::isfinite(d.max)) return descriptor;
  if (std::holds_alternative<int64_t>(d.initial)) {
    rcl_interfaces::msg::IntegerRange range;
    range.from_value = std::isfinite(d.min) ? static_cast<int64_t>(d.min) : std::numeric_limits<int32_t>::min();
    range.to_value = std::isfinite(d.max) ? static_cast<int64_t>(d.max) : std::numeric_limits<int32_t>::max();
    descriptor.integer_range.push_back(range);
  } else {
    rcl_interfaces::msg::FloatingPointRange range;
    range.from_value = std::isfinite(d.min) ? d.min : std::numeric_limits<double>::lowest();
    range.to_value = std::isfinite(d.max) ? d.max : std::numeric_limits<double>::max();
    descriptor.floating_point_range.push_back(range);
  }
  return descriptor;
}

}  // namespace

SlamComponent::SlamComponent(const rclcpp::NodeOptions& options)
    : rclcpp::Node("dkb_slam", options), tf_(get_clock()), tf_listener_(tf_, this), tf_sender_(this) {
  const auto parameters = declare_all();
  odom_ = create_publisher<nav_msgs::msg::Odometry>("odom", 10);
  pose_ = create_publisher<geometry_msgs::msg::PoseWithCovarianceStamped>("pose", 10);
  path_ = create_publisher<nav_msgs::msg::Path>("path", 1);
  points_ = create_publisher<sensor_msgs::msg::PointCloud2>("map_points", 1);
  markers_ = create_publisher<visualization_msgs::msg::MarkerArray>("movers", 10);
  movers_ = create_publisher<msg::Movers>("movers_array", 10);
  features_ = create_publisher<sensor_msgs::msg::Image>("features_image", 1);
  rclcpp::PublisherOptions between_processes;  // within one, messages do not wait for those who come later
  between_processes.use_intra_process_comm = rclcpp::IntraProcessSetting::Disable;
  grid_ = create_publisher<nav_msgs::msg::OccupancyGrid>("grid", rclcpp::QoS(1).transient_local(), between_processes);
  diagnostics_ = create_publisher<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", 1);
  core_ = dkb_ros::make_core(parameters, *this);

  const rclcpp::QoS images = rclcpp::SensorDataQoS().keep_last(10);
  const auto image = [](const sensor_msgs::msg::Image::ConstSharedPtr& m) {
    return dkb_ros::image_from(*m, ns_of(m->header.stamp), m);
  };
  subscribe<sensor_msgs::msg::Image>("rgb/image", images, [=](const auto& m) { core_->colour(image(m)); });
  subscribe<sensor_msgs::msg::Image>("depth/image", images, [=](const auto& m) { core_->depth(image(m)); });
  subscribe<sensor_msgs::msg::CameraInfo>("rgb/camera_info", images, [this](const auto& m) {
    dkb_ros::CameraInfoMessage info;
    info.width = static_cast<int>(m->width);
    info.height = static_cast<int>(m->height);
    info.distortion_model = m->distortion_model;
    info.d = m->d;
    info.k = m->k;
    info.p = m->p;
    core_->camera_info(info);
  });
  subscribe<nav_msgs::msg::Odometry>("odom_prior", rclcpp::SensorDataQoS().keep_last(100), [this](const auto& m) {
    core_->odometry(dkb_ros::odometry_from(*m, ns_of(m->header.stamp)));
  });
  subscribe<sensor_msgs::msg::Imu>("imu", rclcpp::SensorDataQoS().keep_last(1000), [this](const auto& m) {
    core_->imu(dkb_ros::imu_from(*m, ns_of(m->header.stamp)));
  });
  subscribe<geometry_msgs::msg::PoseWithCovarianceStamped>("initialpose", rclcpp::QoS(1), [this](const auto& m) {
    core_->initial_pose(dkb_ros::pose_with_covariance_from(*m, ns_of(m->header.stamp)));
  });
  using MapFile = srv::MapFile;
  using std_srvs::srv::SetBool;
  using std_srvs::srv::Trigger;
  serve<MapFile>("~/save_map", [this](const auto& r, auto done) { core_->save_map(r.path, done); });
  serve<MapFile>("~/load_map", [this](const auto& r, auto done) { core_->load_map(r.path, done); });
  serve<Trigger>("~/reset", [this](const auto&, auto done) { core_->reset(done); });
  serve<SetBool>("~/pause", [this](const auto& r, auto done) { core_->pause(r.data, done); });
  serve<SetBool>("~/localize_only", [this](const auto& r, auto done) { core_->localize_only(r.data, done); });
}

SlamComponent::~SlamComponent() {
  subscriptions_.clear();
  core_.reset();
}

// Every parameter of the table with its description and range; gives those that were set.
std::map<std::string, dkb_ros::ParameterValue> SlamComponent::declare_all() {
  std::map<std::string, dkb_ros::ParameterValue> values;
  const auto& given = get_node_parameters_interface()->get_parameter_overrides();
  for (const dkb_ros::ParameterDescription& d : dkb_ros::parameter_descriptions())
    std::visit(
        [&](const auto& initial) {
          using T = std::decay_t<decltype(initial)>;
          const T value = declare_parameter<T>(d.name, initial, descriptor_of(d));
          if (given.count(d.name) > 0) values[d.name] = value;
        },
        d.initial);
  for (const auto& [name, value] : given)
    if (!has_parameter(name) && name.rfind("qos_overrides.", 0) != 0)  // those of topics are declared with them
      RCLCPP_WARN(get_logger(), "%s: there is no such parameter; docs/ros.md lists them", name.c_str());
  return values;
}

template <class Message, class Callback>
void SlamComponent::subscribe(const std::string& topic, const rclcpp::QoS& qos, Callback callback) {
  rclcpp::SubscriptionOptions options;
  options.qos_overriding_options = {rclcpp::QosPolicyKind::Depth, rclcpp::QosPolicyKind::Reliability};
  subscriptions_.push_back(create_subscription<Message>(
      topic, qos, [callback](typename Message::ConstSharedPtr m) { callback(m); }, options));
}

// The core answers from its tracking thread, so that no callback waits.
template <class Service, class Request>
void SlamComponent::serve(const std::string& name, Request request) {
  using Server = std::shared_ptr<rclcpp::Service<Service>>;
  services_.push_back(create_service<Service>(name, [request](Server server, std::shared_ptr<rmw_request_id_t> id,
                                                              std::shared_ptr<typename Service::Request> asked) {
    request(*asked, RosCore::Done([server, id](const dkb_ros::Answer& answer) {
      typename Service::Response response;
      response.success = answer.success;
      response.message = answer.message;
      server->send_response(*id, response);
    }));
  }));
}

void SlamComponent::log(dkb_ros::LogLevel level, const std::string& text) {
  switch (level) {
    case dkb_ros::LogLevel::info:
      RCLCPP_INFO_STREAM(get_logger(), text);
      break;
    case dkb_ros::LogLevel::warning:
      RCLCPP_WARN_STREAM(get_logger(), text);
      break;
    case dkb_ros::LogLevel::error:
      RCLCPP_ERROR_STREAM(get_logger(), text);
      break;
  }
}

bool SlamComponent::wanted(Topic topic) {
  const rclcpp::PublisherBase* const publishers[] = {odom_.get(),    pose_.get(),   path_.get(),     points_.get(),
                                                     markers_.get(), movers_.get(), features_.get(), grid_.get()};
  const rclcpp::PublisherBase* publisher = publishers[static_cast<size_t>(topic)];
  return publisher->get_subscription_count() + publisher->get_intra_process_subscription_count() > 0;
}

int64_t SlamComponent::now_ns() {
  return now().nanoseconds();
}

std::optional<Rigid3> SlamComponent::transform(const std::string& target, const std::string& source,
                                               std::optional<int64_t> stamp_ns) {
  try {
    const tf2::TimePoint time = stamp_ns ? tf2::TimePoint(std::chrono::nanoseconds(*stamp_ns)) : tf2::TimePointZero;
    return dkb_ros::rigid_from_transform(tf_.lookupTransform(target, source, time).transform);
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
}

void SlamComponent::publish(const std::vector<dkb_ros::TransformOutput>& transforms) {
  std::vector<geometry_msgs::msg::TransformStamped> messages;
  for (const dkb_ros::TransformOutput& t : transforms) {
    messages.push_back(stamped<geometry_msgs::msg::TransformStamped>(t.stamp_ns));
    dkb_ros::fill(t, &messages.back());
  }
  tf_sender_.sendTransform(messages);
}

void SlamComponent::publish(const dkb_ros::OdometryOutput& odometry) {
  auto m = stamped<nav_msgs::msg::Odometry>(odometry.pose.stamp_ns);
  dkb_ros::fill(odometry, &m);
  odom_->publish(m);
}

void SlamComponent::publish(const dkb_ros::PoseMessage& pose) {
  auto m = stamped<geometry_msgs::msg::PoseWithCovarianceStamped>(pose.stamp_ns);
  dkb_ros::fill(pose, &m);
  pose_->publish(m);
}

void SlamComponent::publish(const dkb_ros::PathOutput& path) {
  auto m = stamped<nav_msgs::msg::Path>(path.stamp_ns);
  m.header.frame_id = path.frame_id;
  for (const dkb_ros::PathOutput::Pose& p : path.poses) {
    m.poses.push_back(stamped<geometry_msgs::msg::PoseStamped>(p.stamp_ns));
    m.poses.back().header.frame_id = path.frame_id;
    dkb_ros::set_pose(p.pose, &m.poses.back().pose);
  }
  path_->publish(m);
}

void SlamComponent::publish(const dkb_ros::CloudOutput& points) {
  auto m = std::make_unique<sensor_msgs::msg::PointCloud2>(stamped<sensor_msgs::msg::PointCloud2>(points.stamp_ns));
  dkb_ros::fill(points, m.get());
  points_->publish(std::move(m));
}

void SlamComponent::publish(const dkb_ros::MoversOutput& movers) {
  auto own = stamped<msg::Movers>(movers.stamp_ns);
  dkb_ros::fill_movers(movers, &own);
  movers_->publish(own);
  visualization_msgs::msg::MarkerArray markers;
  dkb_ros::fill_markers(movers, &markers);
  for (auto& marker : markers.markers) marker.header.stamp = own.header.stamp;
  markers_->publish(markers);
}

void SlamComponent::publish(const dkb_ros::ColourImageOutput& features) {
  auto m = std::make_unique<sensor_msgs::msg::Image>(stamped<sensor_msgs::msg::Image>(features.stamp_ns));
  dkb_ros::fill(features, m.get());
  features_->publish(std::move(m));
}

void SlamComponent::publish(const dkb_ros::GridOutput& grid) {
  auto m = stamped<nav_msgs::msg::OccupancyGrid>(grid.stamp_ns);
  dkb_ros::fill(grid, &m);
  grid_->publish(m);
}

void SlamComponent::publish(const dkb_ros::DiagnosticsOutput& diagnostics) {
  auto m = stamped<diagnostic_msgs::msg::DiagnosticArray>(diagnostics.stamp_ns);
  dkb_ros::fill(diagnostics, get_fully_qualified_name(), &m);
  diagnostics_->publish(m);
}

}  // namespace dkb_slam_ros

RCLCPP_COMPONENTS_REGISTER_NODE(dkb_slam_ros::SlamComponent)
