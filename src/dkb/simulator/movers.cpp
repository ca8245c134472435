// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/movers.h"

#include <algorithm>
#include <cmath>

#include "dkb/simulator/camera_path.h"
#include "dkb/simulator/noise.h"

namespace dkb::sim {
namespace {

constexpr double kBody = 0.30;      // [m] kept from walls and furniture
constexpr double kPersonal = 0.65;  // [m] kept between the middles of two people

double wrapped(double a) {
  return std::remainder(a, 6.283185307179586);
}

// One planned stretch: a walk from a to b, or standing at a (b == a).
struct Stretch {
  Eigen::Vector2d a, b;
  double start = 0, end = 0;  // [s]
  // Smooth start and stop: share of the path at a time.
  Eigen::Vector2d at(double t) const {
    if (end <= start) return b;
    return a + eased((t - start) / (end - start), std::min(0.5, 0.35 / (end - start))) * (b - a);
  }
};

class Planner {
 public:
  Planner(const WalkArea& area, double duration, uint64_t seed) : area_(area), duration_(duration), random_(seed) {}

  // `in_view`: who stands still from the start stands where the camera sees it.
  std::vector<Stretch> plan(const std::vector<std::vector<Stretch>>& others, bool in_view) {
    others_ = &others;
    std::vector<Stretch> out;
    double t = -2;
    const bool stands = area_.stand_still > 0;
    const double leave = stands ? area_.stand_still + random_.uniform(0, 0.6) : -1.5;
    Eigen::Vector2d here = start(stands && in_view ? area_.first_place : nullptr, leave);
    if (stands) {
      out.push_back({here, here, t, leave});
      t = leave;
    }
    while (t < duration_ + 1) {
      Stretch next = choose(here, t, stands && out.size() == 1);
      out.push_back(next);
      here = next.b;
      t = next.end;
    }
    return out;
  }

 private:
  bool floor_free(const Eigen::Vector2d& p) const {
    const Footprint& in = area_.inside;
    if (p.x() < in.x0 + kBody || p.x() > in.x1 - kBody || p.y() < in.y0 + kBody || p.y() > in.y1 - kBody) return false;
    return std::none_of(area_.obstacles.begin(), area_.obstacles.end(),
                        [&](const Footprint& f) { return f.distance(p.x(), p.y()) < kBody; });
  }
  bool may_stand(const Eigen::Vector2d& p) const {
    return floor_free(p) && std::none_of(area_.no_stop.begin(), area_.no_stop.end(),
                                         [&](const Footprint& f) { return f.distance(p.x(), p.y()) < kBody; });
  }
  Eigen::Vector2d propose() {
    if (area_.next_target && random_.below(4) != 0) return area_.next_target(random_);
    return {random_.uniform(area_.inside.x0, area_.inside.x1), random_.uniform(area_.inside.y0, area_.inside.y1)};
  }
  static Eigen::Vector2d where(const std::vector<Stretch>& plan, double t) {
    const auto it =
        std::upper_bound(plan.begin(), plan.end(), t, [](double time, const Stretch& s) { return time < s.end; });
    return it == plan.end() ? plan.back().b : it->at(t);
  }
  bool clear(const Stretch& s) const {
    for (double t = s.start; t <= s.end + 1e-9; t += 0.1) {
      const Eigen::Vector2d p = s.at(t);
      if (s.a != s.b && !floor_free(p)) return false;
      if (area_.camera && (area_.camera(t) - p).norm() < area_.camera_distance) return false;
      for (const auto& other : *others_)
        if ((where(other, t) - p).norm() < kPersonal) return false;
    }
    return true;
  }
  Eigen::Vector2d start(const std::function<Eigen::Vector2d(Random&)>& place, double end) {
    Eigen::Vector2d p;
    for (int i = 0; i <= 400; ++i) {
      p = place && i < 200 ? place(random_) : propose();
      if (may_stand(p) && clear({p, p, -2, end})) break;
    }
    return p;
  }
  Stretch choose(const Eigen::Vector2d& here, double t, bool walk_off) {
    constexpr double kSlowest = 0.7, kFastest = 1.4;                               // [m/s]
    constexpr double kPauseChance = 0.4, kShortestPause = 0.4, kLongestPause = 2;  // [s] between two walks
    if (!walk_off && random_.uniform() < kPauseChance) {
      Stretch stand{here, here, t, t + random_.uniform(kShortestPause, kLongestPause)};
      if (clear(stand)) return stand;
    }
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d target = propose();
      const double distance = (target - here).norm(), speed = random_.uniform(kSlowest, kFastest);
      if (distance < 0.8 || !may_stand(target)) continue;
      Stretch walk{here, target, t, t + distance / speed + 0.35};
      if (clear(walk)) return walk;
    }
    return {here, here, t, t + 0.3};
  }

  const WalkArea& area_;
  const double duration_;
  Random random_;
  const std::vector<std::vector<Stretch>>* others_ = nullptr;
};

// Heading, gait and speed from positions.
Track finish(const std::function<Eigen::Vector2d(double)>& where, double duration, bool standing) {
  Track track;
  MoverState s;
  const double dt = Track::kStep;
  const Eigen::Vector2d ahead = where(duration) - where(0);
  s.heading = ahead.norm() > 0.1 ? std::atan2(ahead.y(), ahead.x()) : 0;
  bool moving = standing;
  for (double t = 0; t < duration + dt; t += dt) {
    s.position = where(t);
    s.velocity = (where(t + dt / 2) - where(t - dt / 2)) / dt;
    const double speed = s.velocity.norm();
    if (speed > 0.05) {
      // Turn towards the way ahead, at once at the start, by 5 rad/s later.
      const double wanted = std::atan2(s.velocity.y(), s.velocity.x()), turn = wrapped(wanted - s.heading);
      s.heading += moving ? std::clamp(turn, -5 * dt, 5 * dt) : turn;
      moving = true;
    }
    const double stride = std::min(1.6, speed / 1.1);
    s.stride += std::clamp(stride - s.stride, -4 * dt, 4 * dt);
    s.phase += dt * (speed > 0.02 ? 6.2832 * (0.45 * speed + 0.35 * std::min(1.0, speed)) : 0.0);
    track.push(s);
  }
  return track;
}

}  // namespace

MoverState Track::at(double t) const {
  if (states_.empty()) return {};
  const double x = std::clamp(t / kStep, 0.0, static_cast<double>(states_.size() - 1));
  const auto i = std::min(static_cast<size_t>(x), states_.size() - 1), j = std::min(i + 1, states_.size() - 1);
  const double w = x - static_cast<double>(i);
  const MoverState &a = states_[i], &b = states_[j];
  MoverState s;
  s.position = a.position + w * (b.position - a.position);
  s.velocity = a.velocity + w * (b.velocity - a.velocity);
  s.heading = a.heading + w * wrapped(b.heading - a.heading);
  s.phase = a.phase + w * (b.phase - a.phase);
  s.stride = a.stride + w * (b.stride - a.stride);
  s.tilt = a.tilt + w * (b.tilt - a.tilt);
  return s;
}

void Track::add_sway(uint64_t seed) {
  for (size_t i = 0; i < states_.size(); ++i) {
    const Tremor wave = hand_tremor(0.3 * kStep * static_cast<double>(i), 0, 0.003, seed);
    states_[i].tilt = (1 - std::min(1.0, states_[i].stride)) * Eigen::Vector2d(0.6 * wave.yaw, wave.pitch);
  }
}

std::vector<Track> plan_walks(const WalkArea& area, int count, double duration, uint64_t seed) {
  std::vector<std::vector<Stretch>> plans;
  std::vector<Track> tracks;
  for (int i = 0; i < count; ++i) {
    Planner planner(area, duration, hash64(seed, static_cast<uint64_t>(i), 0x3A1C));
    plans.push_back(planner.plan(plans, i % 2 == 0));
    const std::vector<Stretch>& plan = plans.back();
    tracks.push_back(finish(
        [&plan](double t) {
          for (const Stretch& s : plan)
            if (t < s.end) return s.at(t);
          return plan.back().b;
        },
        duration, area.stand_still > 0));
  }
  return tracks;
}

Track track_along(const std::vector<Waypoint>& points, double duration, bool standing) {
  return finish(
      [&points](double t) -> Eigen::Vector2d {
        if (t <= points.front().time) return points.front().position;
        for (size_t i = 1; i < points.size(); ++i)
          if (t < points[i].time)
            return Stretch{points[i - 1].position, points[i].position, points[i - 1].time, points[i].time}.at(t);
        return points.back().position;
      },
      duration, standing);
}

}  // namespace dkb::sim
