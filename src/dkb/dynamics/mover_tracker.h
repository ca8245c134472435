// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "dkb/dynamics/mover.h"
#include "dkb/dynamics/mover_observer.h"

namespace dkb {

struct MoverTrackerOptions {
  MoverObserverOptions observer = {};
  double sd_across = 0.12;    // [m] standard deviation of an observed position along the image's rows, > 0
  double sd_down = 0.45;      // [m] along its columns: clutter and other movers hide legs and bodies, > 0
  double sd_deep = 0.12;      // [m] along the optical axis, > 0
  double agility = 3.0;       // [m^2/s^3] spectral density of the white noise that acceleration is taken for, > 0
  double speed_sd = 1.2;      // [m/s] standard deviation of the speed of something just found, > 0
  double gate = 25.0;         // squared Mahalanobis distance within which an observation may belong to a track, > 0
  double max_distance = 0.9;  // [m] nor may it lie farther from where it is expected than this, > 0 ...
  double max_distance_growth = 1.5;  // [m/s] ... and this times the time unseen, >= 0
  double class_penalty = 9.0;        // added to the squared distance when classes differ, >= 0
  double box_weight = 2.0;           // times 1 - intersection over union with its last box: added too, >= 0
  double box_memory = 0.3;           // [s] which counts less and less until so long ago, > 0
  double memory = 1.2;               // [s] a mover unseen for longer is forgotten, > 0
  double doubt_memory = 0.2;         // [s] the same before it is confirmed, > 0
  int min_observations = 3;          // that confirm a mover and give it its id, >= 2
  double apart = 0.35;               // [m] nothing is found so near to a mover already seen in the frame, >= 0
  double regions_apart = 0.6;        // [m] the same for regions without a box, across and along the optical axis, >= 0
  void check() const;                // throws InvalidOption
};

// Follows movers through a sequence: obstacles with a place, a velocity and a lasting identity. Observations of
// MoverObserver go to constant-velocity Kalman filters in the world by the smallest total cost over all of them, so
// that identities last when one mover passes behind another. Ids count from 1 in the order of confirmation.
// Deterministic: the same frames in the same order give the same movers.
class MoverTracker {
 public:
  MoverTracker(const CameraModel& camera, const MoverTrackerOptions& options);  // throws InvalidOption

  // The movers that are seen in the frame, by id. `mask`: silhouettes of the boxes, regions that move, or both; empty
  // when nothing moves. `boxes` may be empty: regions of the mask are the objects then. `timestamp` [s] must not go
  // back. Frames whose pose is unknown are left out by the caller.
  std::vector<Mover> update(double timestamp, const DepthImage& depth, const MoverMask& mask,
                            std::span<const Detection> boxes, const Rigid3& world_from_cam);

  // The estimated world has moved under the camera (a loop was closed): what was at p is at new_from_old * p.
  void rebase(const Rigid3& new_from_old);
  // Forgets all movers; ids go on counting.
  void reset() { tracks_.clear(); }

 private:
  using State = Eigen::Matrix<double, 6, 1>;  // position [m], velocity [m/s] in the world
  using Covariance = Eigen::Matrix<double, 6, 6>;
  struct Track {
    int id = 0;  // 0 = not confirmed
    std::string class_name;
    State state;
    Covariance covariance;
    Box box;          // [px] where it was last seen
    double seen = 0;  // [s]
    int observations = 0;
  };
  void predict(double seconds);
  std::vector<int> associate(const std::vector<MoverObservation>& observations, const Eigen::Matrix3d& noise,
                             const Eigen::Vector3d& down) const;
  void correct(const MoverObservation& observation, const Eigen::Matrix3d& noise, Track* track);

  MoverTrackerOptions options_;
  MoverObserver observer_;
  std::vector<Track> tracks_;
  double time_ = 0;
  int last_id_ = 0;
};

}  // namespace dkb
