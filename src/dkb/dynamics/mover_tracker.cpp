// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "dkb/dynamics/assignment.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kUnassigned = 50.0;  // above what fits: what can be explained is
constexpr const char* kUnnamed = "object";

}  // namespace

void MoverTrackerOptions::check() const {
  observer.check();
  require_option(sd_across > 0, "sd_across", sd_across, "greater than 0 m");
  require_option(sd_down > 0, "sd_down", sd_down, "greater than 0 m");
  require_option(sd_deep > 0, "sd_deep", sd_deep, "greater than 0 m");
  require_option(agility > 0, "agility", agility, "greater than 0 m^2/s^3");
  require_option(speed_sd > 0, "speed_sd", speed_sd, "greater than 0 m/s");
  require_option(gate > 0, "gate", gate, "greater than 0");
  require_option(max_distance > 0, "max_distance", max_distance, "greater than 0 m");
  require_option(max_distance_growth >= 0, "max_distance_growth", max_distance_growth, "at least 0 m/s");
  require_option(class_penalty >= 0, "class_penalty", class_penalty, "at least 0");
  require_option(box_weight >= 0, "box_weight", box_weight, "at least 0");
  require_option(box_memory > 0, "box_memory", box_memory, "greater than 0 s");
  require_option(memory > 0, "memory", memory, "greater than 0 s");
  require_option(doubt_memory > 0, "doubt_memory", doubt_memory, "greater than 0 s");
  require_option(min_observations >= 2, "min_observations", min_observations, "at least 2");
  require_option(apart >= 0, "apart", apart, "at least 0 m");
  require_option(regions_apart >= 0, "regions_apart", regions_apart, "at least 0 m");
}

MoverTracker::MoverTracker(const CameraModel& camera, const MoverTrackerOptions& options)
    : options_((options.check(), options)), observer_(camera, options.observer) {}

void MoverTracker::predict(double seconds) {
  Covariance transition = Covariance::Identity();
  transition.topRightCorner<3, 3>() = seconds * Eigen::Matrix3d::Identity();
  Covariance noise = Covariance::Zero();
  noise.diagonal().head<3>().setConstant(seconds * seconds * seconds / 3);
  noise.diagonal().tail<3>().setConstant(seconds);
  noise.topRightCorner<3, 3>().diagonal().setConstant(0.5 * seconds * seconds);
  noise.bottomLeftCorner<3, 3>() = noise.topRightCorner<3, 3>();
  for (Track& t : tracks_) {
    t.state.head<3>() += seconds * t.state.tail<3>();
    t.covariance = transition * t.covariance * transition.transpose() + options_.agility * noise;
  }
}

// Index of the observation of each track, -1 = none.
std::vector<int> MoverTracker::associate(const std::vector<MoverObservation>& observations,
                                         const Eigen::Matrix3d& noise, const Eigen::Vector3d& down) const {
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(static_cast<Eigen::Index>(tracks_.size()),
                                                   static_cast<Eigen::Index>(observations.size()), kUnassigned);
  const double noise_determinant = noise.determinant();
  for (size_t i = 0; i < tracks_.size(); ++i) {
    const Track& t = tracks_[i];
    const Eigen::Matrix3d spread = t.covariance.topLeftCorner<3, 3>() + noise;
    const Eigen::Matrix3d information = spread.inverse();
    // A mover long unseen fits anywhere: half its log likelihood's width keeps it from taking what others fit better.
    const double width = 0.5 * std::log(spread.determinant() / noise_determinant);
    const double unseen = time_ - t.seen, max_distance = options_.max_distance + options_.max_distance_growth * unseen;
    const double box_weight = options_.box_weight * std::max(0.0, 1 - unseen / options_.box_memory);
    for (size_t k = 0; k < observations.size(); ++k) {
      const MoverObservation& o = observations[k];
      const Eigen::Vector3d off = o.position_in_world - t.state.head<3>();
      const double distance = off.dot(information * off), aside = (off - off.dot(down) * down).norm();
      if (distance > options_.gate || aside > max_distance) continue;
      double penalty = box_weight * (1 - static_cast<double>(intersection_over_union(t.box, o.box)));
      if (!o.class_name.empty() && !t.class_name.empty() && o.class_name != t.class_name)
        penalty += options_.class_penalty;
      cost(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          std::min(distance + width + penalty, 0.999 * kUnassigned);
    }
  }
  return assign(cost, kUnassigned);
}

void MoverTracker::correct(const MoverObservation& o, const Eigen::Matrix3d& noise, Track* t) {
  const Eigen::Matrix3d spread = t->covariance.topLeftCorner<3, 3>() + noise;
  const Eigen::Matrix<double, 6, 3> gain = t->covariance.leftCols<3>() * spread.inverse();
  t->state += gain * (o.position_in_world - t->state.head<3>());
  const Covariance less = gain * t->covariance.topRows<3>();
  t->covariance -= 0.5 * (less + less.transpose());
  t->seen = time_;
  t->box = o.box;
  if (!o.class_name.empty()) t->class_name = o.class_name;
  if (++t->observations >= options_.min_observations && t->id == 0) t->id = ++last_id_;
}

std::vector<Mover> MoverTracker::update(double timestamp, const DepthImage& depth, const MoverMask& mask,
                                        std::span<const Detection> boxes, const Rigid3& world_from_cam) {
  predict(std::max(0.0, timestamp - time_));
  time_ = timestamp;
  std::erase_if(tracks_,
                [&](const Track& t) { return time_ - t.seen > (t.id > 0 ? options_.memory : options_.doubt_memory); });

  const std::vector<MoverObservation> observations = observer_.observe(depth, mask, boxes, world_from_cam);
  const Eigen::Vector3d sd(options_.sd_across, options_.sd_down, options_.sd_deep);
  const Eigen::Matrix3d axes = world_from_cam.matrix3();
  const Eigen::Matrix3d noise = axes * sd.cwiseAbs2().asDiagonal() * axes.transpose();

  const std::vector<int> observation_of = associate(observations, noise, axes.col(1));

  std::vector<Mover> movers;
  std::vector<char> taken(observations.size(), 0);
  std::vector<Eigen::Vector3d> seen;
  for (size_t i = 0; i < observation_of.size(); ++i) {
    if (observation_of[i] < 0) continue;
    const auto k = static_cast<size_t>(observation_of[i]);
    taken[k] = 1;
    const MoverObservation& o = observations[k];
    Track& t = tracks_[i];
    correct(o, noise, &t);
    seen.push_back(o.position_in_world);
    if (t.id == 0) continue;
    movers.push_back({t.id, t.class_name.empty() ? kUnnamed : t.class_name, o.position_in_world, t.state.tail<3>(),
                      o.position_sd, o.box});
  }
  for (size_t k = 0; k < observations.size(); ++k) {
    const MoverObservation& o = observations[k];
    if (taken[k]) continue;
    // Parts of one body may be taken for several regions, one above the other.
    const double apart = o.class_name.empty() ? options_.regions_apart : options_.apart;
    const auto near = [&](const Eigen::Vector3d& p) {
      const Eigen::Vector3d off = p - o.position_in_world;
      return (o.class_name.empty() ? (off - off.dot(axes.col(1)) * axes.col(1)).norm() : off.norm()) < apart;
    };
    if (std::any_of(seen.begin(), seen.end(), near)) continue;
    seen.push_back(o.position_in_world);
    Track t;
    t.class_name = o.class_name;
    t.state << o.position_in_world, Eigen::Vector3d::Zero();
    t.covariance.setZero();
    t.covariance.topLeftCorner<3, 3>() = noise;
    t.covariance.diagonal().tail<3>().setConstant(options_.speed_sd * options_.speed_sd);
    t.seen = time_;
    t.box = o.box;
    t.observations = 1;
    tracks_.push_back(std::move(t));
  }
  std::sort(movers.begin(), movers.end(), [](const Mover& a, const Mover& b) { return a.id < b.id; });
  return movers;
}

void MoverTracker::rebase(const Rigid3& new_from_old) {
  Covariance rotation = Covariance::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() = new_from_old.matrix3();
  for (Track& t : tracks_) {
    t.state.head<3>() = new_from_old * t.state.head<3>();
    t.state.tail<3>() = new_from_old.rotation * t.state.tail<3>();
    t.covariance = rotation * t.covariance * rotation.transpose();
  }
}

}  // namespace dkb
