// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "dkb/dynamics/mover_observer.h"
#include "dkb_slam/frame.h"

namespace dkb {

// What of one frame may be movers, seen from where the camera was expected to be.
struct MoverSighting {
  std::vector<MoverObservation> observations;
  std::vector<size_t> tracks;  // that were told to the observer: MoverObservation::expected is an index of these
  Rigid3 world_from_cam;       // as expected

  // The same from where the camera is.
  void move_to(const Rigid3& world_from_cam_found);
};

// Follows movers through a sequence: obstacles with a place, a velocity and a lasting identity. Observations of
// MoverObserver go to constant-velocity Kalman filters in the world by the smallest total cost over all of them, so
// that identities last when one mover passes behind another. Ids count from 1 in the order of confirmation.
// Deterministic: the same frames in the same order give the same movers.
class MoverTracker {
 public:
  MoverTracker(const CameraModel& camera, const SensorNoise& noise)
      : camera_(camera), noise_(noise), observer_(camera) {}

  // Looks for movers in a frame whose pose may be but expected. `mask`: silhouettes of the boxes, regions that move, or
  // both; empty when nothing moves. `boxes` may be empty: regions of the mask are the objects then. `timestamp` [s]
  // must not go back.
  MoverSighting look(double timestamp, const DepthImage& depth, const MoverMask& mask, std::span<const Detection> boxes,
                     const Rigid3& world_from_cam_expected);
  // The movers that are seen in the frame looked at last, by id; also those who have moved and stand still, for as long
  // as nothing is seen through where they are, and those of whom but a box without depth is left. Frames whose pose
  // remains unknown are left out by the caller.
  std::vector<Mover> update(MoverSighting sighting, const DepthImage& depth, const Rigid3& world_from_cam);

  // The estimated world has moved under the camera (a loop was closed): what was at p is at new_from_old * p.
  void rebase(const Rigid3& new_from_old);

 private:
  using State = Eigen::Matrix<double, 6, 1>;  // position [m], velocity [m/s] in the world
  using Covariance = Eigen::Matrix<double, 6, 6>;
  struct Track {
    int id = 0;  // 0 = not confirmed
    std::string class_name;
    State state;
    Covariance covariance;
    Box box;                         // [px] where it was last seen
    double seen = 0;                 // [s]
    double missed = 0;               // [s] unseen since, though nothing hid it
    bool hidden = false;             // in the frame before
    MoverSurface before;             // as it was seen when it was found, or half a metre ago
    bool moved = false;              // away from there
    Eigen::Vector3d size{0, 0, 0};   // [m] as last seen
    double position_sd = 0;          // [m] the same
    MoverSurface surface;            // as last seen whole
    int observations = 0;
  };
  void predict(double seconds);
  std::vector<int> associate(const MoverSighting& sighting, const Eigen::Matrix3d& noise,
                             const Eigen::Vector3d& down) const;
  Eigen::Vector3d place(const MoverObservation& observation, const Track& track) const;
  bool stands_behind(const Track& track, const DepthImage& depth) const;
  void remember(const MoverObservation& observation, const DepthImage& depth, Track* track) const;
  void correct(const MoverObservation& observation, Eigen::Matrix3d noise, Track* track);

  CameraModel camera_;
  SensorNoise noise_;
  MoverObserver observer_;
  std::vector<Track> tracks_;
  double time_ = 0;
  Rigid3 world_from_cam_;
  int last_id_ = 0;
};

}  // namespace dkb
