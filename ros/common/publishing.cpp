// SPDX-License-Identifier: Apache-2.0
// What the core tells of each frame.
#include <algorithm>
#include <cmath>

#include "inputs.h"
#include "outputs.h"
#include "slam_core.h"

namespace dkb_ros {
namespace {

constexpr size_t kMaxUnplaced = 30;  // [frames] that wait for the robot's odometry

}  // namespace

void SlamCore::publish(const ImagePair& pair, const dkb::FrameResult& result, const std::string& hindrance) {
  if (parameters_.publish_odom_tf) publish_odometry(result);  // else `odom` is the robot's
  const double out_ms =
      1e-6 * static_cast<double>(steady_ns() - std::max(pair.colour.arrived_ns, pair.depth.arrived_ns));
  {
    const std::lock_guard lock(report_mutex_);
    trouble_.clear();
    state_ = result.state;
    hindrance_ = hindrance;
    last_result_stamp_ns_ = result.stamp_ns;
    ++counts_.frames;
    counts_.tracked += result.tracked();
    counts_.predicted += result.state == dkb::TrackingState::predicted;
    counts_.lost += result.state == dkb::TrackingState::lost;
    counts_.ambiguous += result.ambiguous;
    counts_.paused += result.state == dkb::TrackingState::paused;
    ++recent_.frames;
    recent_.skew_ms.add(1e-6 * static_cast<double>(std::abs(pair.colour.stamp_ns - pair.depth.stamp_ns)));
    recent_.tracking_ms.add(result.tracking_ms);
    recent_.latency_ms.add(out_ms);
    recent_.overhead_ms.add(out_ms - result.tracking_ms - result.waiting_ms);
  }
  publish_transforms(result);
  if (middleware_.wanted(Topic::movers) || middleware_.wanted(Topic::movers_array)) {
    MoversOutput movers = movers_of(result);
    movers.frame_id = parameters_.map_frame;
    if (!in_map_frame(result)) movers.movers.clear();
    middleware_.publish(movers);
  }
  if (middleware_.wanted(Topic::features_image)) {
    ColourImageOutput image = draw_features(view_of(pair.colour, false), result);
    image.stamp_ns = result.stamp_ns;
    image.frame_id = camera_frame_;
    middleware_.publish(image);
  }
}

void SlamCore::publish_odometry(const dkb::FrameResult& result) {
  if (!result.tracked()) {
    last_pose_.reset();
    return;
  }
  // How the camera came to where it is found is not known, nor how far off guesses were when images tell again:
  // odometry may be held then, which is no standing still.
  const bool guessed = result.state == dkb::TrackingState::predicted;
  if (result.state == dkb::TrackingState::relocalised || (last_pose_ && last_pose_->guessed && !guessed))
    last_pose_.reset();
  const Rigid3 odom_from_base = *result.odom_from_cam * base_from_cam_.inverse();
  const Matrix6d covariance = result.covariance.value_or(Matrix6d::Identity());
  OdometryOutput odometry;
  odometry.pose = {result.stamp_ns, parameters_.odom_frame, odom_from_base,
                   ros_covariance(covariance, base_from_cam_, odom_from_base.rotation)};
  odometry.child_frame_id = parameters_.base_frame;
  const Matrix6d to_base = adjoint(base_from_cam_);
  const Matrix6d in_base = to_base * covariance * to_base.transpose();
  const double dt = last_pose_ ? 1e-9 * static_cast<double>(result.stamp_ns - last_pose_->stamp_ns) : 0;
  if (dt > 0) {
    // The errors of both poses are taken for independent: an upper bound, since they share the map's.
    odometry.twist = twist_of(last_pose_->odom_from_base.inverse() * odom_from_base) / dt;
    odometry.twist_covariance = (last_pose_->covariance + in_base) / (dt * dt);
  } else {
    odometry.twist_covariance = 1e6 * Matrix6d::Identity();  // not known
  }
  last_pose_ = LastPose{result.stamp_ns, odom_from_base, in_base, guessed};
  middleware_.publish(odometry);
}

// A map that was loaded is what others plan in: one begun beside it lies nobody knows where.
bool SlamCore::in_map_frame(const dkb::FrameResult& result) {
  if (!result.tracked()) return false;
  if (loaded_map_.empty()) return true;
  // Maps that are joined take numbers away: that of a new map falls then. While the number stays, so does the answer.
  if (result.map != last_map_) {
    last_map_ = result.map;
    loaded_maps_ = loaded_maps(slam_->keyframes());
  }
  return loaded_maps_ == 0 || result.map < loaded_maps_;
}

void SlamCore::publish_transforms(const dkb::FrameResult& result) {
  const Rigid3 cam_from_base = base_from_cam_.inverse();
  std::vector<TransformOutput> transforms;
  if (result.tracked() && parameters_.publish_odom_tf)
    transforms.push_back(
        {result.stamp_ns, parameters_.odom_frame, parameters_.base_frame, *result.odom_from_cam * cam_from_base});
  if (in_map_frame(result)) {
    const Rigid3 map_from_base = *result.world_from_cam * cam_from_base;
    if (parameters_.publish_odom_tf) {
      map_from_odom_ = result.world_from_odom;
    } else {
      place_robots_odometry(result.stamp_ns, map_from_base);
    }
    if (middleware_.wanted(Topic::pose))
      middleware_.publish(PoseMessage{
          result.stamp_ns, parameters_.map_frame, map_from_base,
          ros_covariance(result.covariance.value_or(Matrix6d::Identity()), base_from_cam_, map_from_base.rotation)});
  }
  // While nobody knows where in the map the camera is, the last one holds.
  if (parameters_.publish_map_tf && map_from_odom_)
    transforms.push_back({result.stamp_ns, parameters_.map_frame, parameters_.odom_frame, *map_from_odom_});
  if (!transforms.empty()) middleware_.publish(transforms);
}

// map -> odom, where odom -> base is the robot's. Its odometry of a frame's time may come later than the frame's pose.
void SlamCore::place_robots_odometry(int64_t stamp_ns, const Rigid3& map_from_base) {
  unplaced_.emplace_back(stamp_ns, map_from_base);
  if (unplaced_.size() > kMaxUnplaced) unplaced_.pop_front();
  for (auto frame = unplaced_.rbegin(); frame != unplaced_.rend(); ++frame) {
    const auto odom_from_base = middleware_.transform(parameters_.odom_frame, parameters_.base_frame, frame->first);
    if (!odom_from_base) continue;
    map_from_odom_ = frame->second * odom_from_base->inverse();
    unplaced_.erase(unplaced_.begin(), frame.base());
    return;
  }
  if (unplaced_.size() == kMaxUnplaced)
    complain(LogLevel::warning, "no transform from " + parameters_.odom_frame + " to " + parameters_.base_frame +
                                    " at the images' times; with `publish_odom_tf` false the robot must send it");
}

}  // namespace dkb_ros
