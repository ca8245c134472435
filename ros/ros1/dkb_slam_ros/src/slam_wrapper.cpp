// SPDX-License-Identifier: Apache-2.0
#include "slam_wrapper.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <dkb_slam_ros/Movers.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <future>

#include "messages.h"

namespace dkb_slam_ros {
namespace {

using dkb_ros::Rigid3;
using dkb_ros::RosCore;
using dkb_ros::Topic;

constexpr uint32_t kQueue = 10;  // [messages] in the transport; the core has a queue of its own

ros::Time time_of(int64_t stamp_ns) {
  return ros::Time().fromNSec(static_cast<uint64_t>(std::max<int64_t>(stamp_ns, 0)));
}

int64_t ns_of(const ros::Time& time) {
  return static_cast<int64_t>(time.toNSec());
}

template <class Message>
Message stamped(int64_t stamp_ns) {
  Message m;
  m.header.stamp = time_of(stamp_ns);
  return m;
}

// ROS 1's names take slashes for our dots: `features: {count: 1000}` in a parameter file.
std::map<std::string, dkb_ros::ParameterValue> read_parameters(const ros::NodeHandle& nh) {
  std::map<std::string, dkb_ros::ParameterValue> values;
  for (const dkb_ros::ParameterDescription& d : dkb_ros::parameter_descriptions()) {
    std::string name = d.name;
    std::replace(name.begin(), name.end(), '.', '/');
    if (!nh.hasParam(name)) continue;
    const bool of_its_type = std::visit(
        [&](auto initial) {
          using T = decltype(initial);
          std::conditional_t<std::is_same_v<T, int64_t>, int, T> value{};  // the parameter server's integers
          if (!nh.getParam(name, value)) return false;
          values[d.name] = T(value);
          return true;
        },
        d.initial);
    if (!of_its_type) throw dkb::InputError(name + ": its type is wrong; docs/ros.md lists the parameters");
  }
  return values;
}

// A misspelt parameter must not be silent.
void warn_of_unknown_parameters(const ros::NodeHandle& nh) {
  std::vector<std::string> names;
  if (!nh.getParamNames(names)) return;
  const std::string prefix = nh.getNamespace() + "/";
  for (std::string name : names) {
    if (name.rfind(prefix, 0) != 0) continue;
    name = name.substr(prefix.size());
    std::string dotted = name;
    std::replace(dotted.begin(), dotted.end(), '/', '.');
    const auto& known = dkb_ros::parameter_descriptions();
    if (std::none_of(known.begin(), known.end(), [&](const auto& d) { return d.name == dotted; }))
      ROS_WARN("%s: there is no such parameter; docs/ros.md lists them", name.c_str());
  }
}

}  // namespace

SlamWrapper::SlamWrapper(ros::NodeHandle nh, ros::NodeHandle private_nh) : name_(private_nh.getNamespace()) {
  const auto parameters = read_parameters(private_nh);
  warn_of_unknown_parameters(private_nh);
  odom_ = nh.advertise<nav_msgs::Odometry>("odom", kQueue);
  pose_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", kQueue);
  path_ = nh.advertise<nav_msgs::Path>("path", 1);
  points_ = nh.advertise<sensor_msgs::PointCloud2>("map_points", 1);
  markers_ = nh.advertise<visualization_msgs::MarkerArray>("movers", kQueue);
  movers_ = nh.advertise<Movers>("movers_array", kQueue);
  features_ = nh.advertise<sensor_msgs::Image>("features_image", 1);
  grid_ = nh.advertise<nav_msgs::OccupancyGrid>("grid", 1, true);
  diagnostics_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1);
  core_ = dkb_ros::make_core(parameters, *this);
  nh.setCallbackQueue(&input_queue_);
  const auto image = [](const sensor_msgs::ImageConstPtr& m) {
    return dkb_ros::image_from(*m, ns_of(m->header.stamp), std::shared_ptr<const void>(m.get(), [m](const void*) {}));
  };
  subscribe<sensor_msgs::Image>(nh, "rgb/image", kQueue, [=](const auto& m) { core_->colour(image(m)); });
  subscribe<sensor_msgs::Image>(nh, "depth/image", kQueue, [=](const auto& m) { core_->depth(image(m)); });
  subscribe<sensor_msgs::CameraInfo>(nh, "rgb/camera_info", kQueue, [this](const auto& m) {
    dkb_ros::CameraInfoMessage info;
    info.width = static_cast<int>(m->width);
    info.height = static_cast<int>(m->height);
    info.distortion_model = m->distortion_model;
    info.d = m->D;
    std::copy(m->K.begin(), m->K.end(), info.k.begin());
    std::copy(m->P.begin(), m->P.end(), info.p.begin());
    core_->camera_info(info);
  });
  subscribe<nav_msgs::Odometry>(nh, "odom_prior", 100, [this](const auto& m) {
    core_->odometry(dkb_ros::odometry_from(*m, ns_of(m->header.stamp)));
  });
  subscribe<sensor_msgs::Imu>(nh, "imu", 1000,
                              [this](const auto& m) { core_->imu(dkb_ros::imu_from(*m, ns_of(m->header.stamp))); });
  subscribe<geometry_msgs::PoseWithCovarianceStamped>(nh, "initialpose", 1, [this](const auto& m) {
    core_->initial_pose(dkb_ros::pose_with_covariance_from(*m, ns_of(m->header.stamp)));
  });
  private_nh.setCallbackQueue(&service_queue_);
  serve<MapFile>(private_nh, "save_map", [this](const auto& r, auto done) { core_->save_map(r.path, done); });
  serve<MapFile>(private_nh, "load_map", [this](const auto& r, auto done) { core_->load_map(r.path, done); });
  serve<std_srvs::Trigger>(private_nh, "reset", [this](const auto&, auto done) { core_->reset(done); });
  serve<std_srvs::SetBool>(private_nh, "pause", [this](const auto& r, auto done) { core_->pause(r.data, done); });
  serve<std_srvs::SetBool>(private_nh, "localize_only",
                           [this](const auto& r, auto done) { core_->localize_only(r.data, done); });
  input_spinner_.start();
  service_spinner_.start();
}

SlamWrapper::~SlamWrapper() {
  // No callback may come once the core is gone; a service in work waits for the core's answer first.
  input_spinner_.stop();
  service_spinner_.stop();
  subscribers_.clear();
  services_.clear();
  core_.reset();
}

template <class Message, class Callback>
void SlamWrapper::subscribe(ros::NodeHandle& nh, const std::string& topic, uint32_t queue, Callback callback) {
  subscribers_.push_back(nh.subscribe<Message>(
      topic, queue, [callback](const boost::shared_ptr<const Message>& m) { callback(m); }, ros::VoidConstPtr(),
      ros::TransportHints().tcpNoDelay()));
}

template <class Service, class Request>
void SlamWrapper::serve(ros::NodeHandle& nh, const std::string& name, Request request) {
  using Asked = typename Service::Request;
  using Response = typename Service::Response;
  services_.push_back(nh.advertiseService<Asked, Response>(
      name, boost::function<bool(Asked&, Response&)>([request](Asked& asked, Response& response) {
        std::promise<dkb_ros::Answer> promise;
        request(asked, RosCore::Done([&](const dkb_ros::Answer& a) { promise.set_value(a); }));
        const dkb_ros::Answer answer = promise.get_future().get();
        response.success = answer.success;
        response.message = answer.message;
        return true;
      })));
}

void SlamWrapper::log(dkb_ros::LogLevel level, const std::string& text) {
  switch (level) {
    case dkb_ros::LogLevel::info:
      ROS_INFO_STREAM(text);
      break;
    case dkb_ros::LogLevel::warning:
      ROS_WARN_STREAM(text);
      break;
    case dkb_ros::LogLevel::error:
      ROS_ERROR_STREAM(text);
      break;
  }
}

bool SlamWrapper::wanted(Topic topic) {
  const ros::Publisher* const publishers[] = {&odom_,    &pose_,   &path_,     &points_,
                                              &markers_, &movers_, &features_, &grid_};
  return publishers[static_cast<size_t>(topic)]->getNumSubscribers() > 0;
}

int64_t SlamWrapper::now_ns() {
  return ns_of(ros::Time::now());
}

std::optional<Rigid3> SlamWrapper::transform(const std::string& target, const std::string& source,
                                             std::optional<int64_t> stamp_ns) {
  try {
    return dkb_ros::rigid_from_transform(
        tf_.lookupTransform(target, source, stamp_ns ? time_of(*stamp_ns) : ros::Time(0)).transform);
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
}

void SlamWrapper::publish(const std::vector<dkb_ros::TransformOutput>& transforms) {
  std::vector<geometry_msgs::TransformStamped> messages;
  for (const dkb_ros::TransformOutput& t : transforms) {
    messages.push_back(stamped<geometry_msgs::TransformStamped>(t.stamp_ns));
    dkb_ros::fill(t, &messages.back());
  }
  tf_sender_.sendTransform(messages);
}

void SlamWrapper::publish(const dkb_ros::OdometryOutput& odometry) {
  auto m = stamped<nav_msgs::Odometry>(odometry.pose.stamp_ns);
  dkb_ros::fill(odometry, &m);
  odom_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::PoseMessage& pose) {
  auto m = stamped<geometry_msgs::PoseWithCovarianceStamped>(pose.stamp_ns);
  dkb_ros::fill(pose, &m);
  pose_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::PathOutput& path) {
  auto m = stamped<nav_msgs::Path>(path.stamp_ns);
  m.header.frame_id = path.frame_id;
  for (const dkb_ros::PathOutput::Pose& p : path.poses) {
    m.poses.push_back(stamped<geometry_msgs::PoseStamped>(p.stamp_ns));
    m.poses.back().header.frame_id = path.frame_id;
    dkb_ros::set_pose(p.pose, &m.poses.back().pose);
  }
  path_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::CloudOutput& points) {
  auto m = stamped<sensor_msgs::PointCloud2>(points.stamp_ns);
  dkb_ros::fill(points, &m);
  points_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::MoversOutput& movers) {
  auto own = stamped<Movers>(movers.stamp_ns);
  dkb_ros::fill_movers(movers, &own);
  movers_.publish(own);
  visualization_msgs::MarkerArray markers;
  dkb_ros::fill_markers(movers, &markers);
  for (auto& marker : markers.markers) marker.header.stamp = own.header.stamp;
  markers_.publish(markers);
}

void SlamWrapper::publish(const dkb_ros::ColourImageOutput& features) {
  auto m = stamped<sensor_msgs::Image>(features.stamp_ns);
  dkb_ros::fill(features, &m);
  features_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::GridOutput& grid) {
  auto m = stamped<nav_msgs::OccupancyGrid>(grid.stamp_ns);
  dkb_ros::fill(grid, &m);
  grid_.publish(m);
}

void SlamWrapper::publish(const dkb_ros::DiagnosticsOutput& diagnostics) {
  auto m = stamped<diagnostic_msgs::DiagnosticArray>(diagnostics.stamp_ns);
  dkb_ros::fill(diagnostics, name_, &m);
  diagnostics_.publish(m);
}

}  // namespace dkb_slam_ros
