// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dkb/simulator/furniture.h"
#include "dkb/simulator/materials.h"
#include "dkb/simulator/surfaces.h"

namespace dkb::sim {

// How a person looks and is built.
struct PersonLook {
  double height = 1.75;  // [m]
  double girth = 1;      // width and depth of the body
  double arms_out = 0;   // [rad] arms held away from the body
  int shirt = 0, trousers = 0, skin = 0, face = 0, hair = 0, shoes = 0;
};
PersonLook make_person_look(Materials* materials, uint64_t seed);

// Where a mover is and how it stands.
struct MoverState {
  Eigen::Vector2d position{0, 0};  // [m] on the floor
  Eigen::Vector2d velocity{0, 0};  // [m/s]
  double heading = 0;              // [rad] of its front, from +x towards +y
  double phase = 0;                // [rad] of the gait
  double stride = 0;               // 0 stands, 1 walks, up to 1.6 runs
  Eigen::Vector2d tilt{0, 0};      // [rad] of the whole body about its feet: to its left, forward
};

// A motion over time: evenly spaced states, interpolated; before the first and after the last they stay.
class Track {
 public:
  static constexpr double kStep = 0.02;  // [s]
  void push(const MoverState& s) { states_.push_back(s); }
  // Lets a person sway about the feet as people do who stand: 3 mrad (5 mm at the head), up to 1 Hz; less in a stride.
  void add_sway(uint64_t seed);
  MoverState at(double t) const;

 private:
  std::vector<MoverState> states_;
};

// Something that moves by itself; times are seconds from the start of the sequence.
struct Mover {
  int id = 0;                   // 1, 2, ...
  std::string kind = "person";  // class
  Track track;
  PersonLook look;  // of persons
  Surfaces rigid;   // of others: in their own frame, front to +x, on the floor

  Surfaces surfaces(double t) const;
};

Surfaces person_surfaces(const PersonLook& look, const MoverState& state);

// Where people may walk, and what they keep away from.
struct WalkArea {
  Footprint inside;  // walls
  std::vector<Footprint> obstacles;
  std::function<Eigen::Vector2d(double)> camera;        // position on the floor at a time
  double camera_distance = 0.8;                         // [m] they keep from it
  std::vector<Footprint> no_stop;                       // where they walk through, but do not stand
  std::function<Eigen::Vector2d(Random&)> next_target;  // proposes where to go; may be empty: anywhere
  double stand_still = 0;                               // [s] all stand from the start, then walk off
  // Where every second one of those stands, so that the camera sees it; the others as by `next_target`.
  std::function<Eigen::Vector2d(Random&)> first_place;
};

// Tracks of `count` people for `duration` seconds: straight walks with smooth starts, stops and turns, which keep clear
// of walls, furniture, the camera and each other.
std::vector<Track> plan_walks(const WalkArea& area, int count, double duration, uint64_t seed);

// A track along waypoints (position, time of arrival [s]), smooth in between; heading along the motion. `standing`: who
// starts to walk turns before, as everybody else does on the way.
struct Waypoint {
  Eigen::Vector2d position;
  double time = 0;
};
Track track_along(const std::vector<Waypoint>& points, double duration, bool standing = false);

}  // namespace dkb::sim
