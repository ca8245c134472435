// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/second_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dkb/geometry/decompositions.h"
#include "dkb/geometry/view_place.h"

namespace dkb {
namespace {

constexpr double kFarthest = 60;     // squared error beyond which a match is wrong by any motion
constexpr double kWrong = 20;        // the most that a match costs, as one of a squared error of 110
constexpr double kApart = 2;         // the cost of a neighbour of the other motion
constexpr size_t kNeighbours = 5;    // of a match, beside each other in the image and in depth
constexpr size_t kQuarters = 4;      // of the matches by depth, between which near and far are told apart at first
constexpr int kRounds = 5;           // of what is of which motion, and of the motions
constexpr double kSmallest = 0.125;  // of the matches: fewer do not take a robust pose along
constexpr double kInfoOfBody = 1e2;  // [1/m^2, 1/rad^2] of a body's motion beside the camera's: 0.1 m, 0.1 rad
// What a match costs that moves, beside its error. Nothing moves in fr1_xyz, and there a second motion saves 0.15 for
// each of its matches as a median and 0.8 at most (lens, shutter and depth are not as modelled); where somebody walks
// off, 1 to 5.
constexpr double kMoves = 1.1;

double cost_of(double squared_error) {
  return std::min((kStudentFreedom + 2) * std::log1p(squared_error / kStudentFreedom), kWrong);
}

// Half the second derivative and half the derivative of a sum of squares about a perturbation of zero.
struct Normal {
  Matrix6d h = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();

  void add(double weight, const Normal& other) {
    h += weight * other.h;
    g += weight * other.g;
  }
  Vector6d solve() const { return -solve_symmetric(h, g); }
};

Normal any_motion() {
  return {Matrix6d::Identity() * kInfoOfBody, Vector6d::Zero()};
}

// A match whose error over its standard deviations is e + J d at the pose after the perturbation d.
struct Match {
  size_t observation;
  double depth;  // [m]
  Eigen::Vector3d error;
  Eigen::Matrix<double, 3, 6> jacobian;

  double squared_error(const Vector6d& d) const { return (error + jacobian * d).squaredNorm(); }
  Normal normal() const { return {jacobian.transpose() * jacobian, jacobian.transpose() * error}; }
};

Match linearise(const CameraModel& camera, const Eigen::Vector3d& q, const PoseObservation& o, size_t observation) {
  const double inverse = 1 / q.z(), fx = camera.fx * inverse / o.pixel_sigma, fy = camera.fy * inverse / o.pixel_sigma;
  const double inv_depth_sigma = o.depth > 0 ? 1 / o.depth_sigma : 0;
  Match m{observation, q.z(), {}, {}};
  m.error << (camera.project(q) - o.pixel) / o.pixel_sigma, (q.z() - o.depth) * inv_depth_sigma;
  Eigen::Matrix3d by_point;
  by_point << fx, 0, -fx * q.x() * inverse, 0, fy, -fy * q.y() * inverse, 0, 0, inv_depth_sigma;
  m.jacobian << -by_point, by_point * skew(q);
  return m;
}

// Those that may be right by the pose, or by the `other` perturbation of it where there is one.
std::vector<Match> matches_of(const CameraModel& camera, const Rigid3& pose,
                              std::span<const PoseObservation> observations, const Vector6d* other = nullptr) {
  std::vector<Match> matches;
  matches.reserve(observations.size());
  for (size_t i = 0; i < observations.size(); ++i) {
    const Eigen::Vector3d q = pose * observations[i].point_in_world;
    if (!(q.z() > 0)) continue;
    const Match m = linearise(camera, q, observations[i], i);
    if (m.error.squaredNorm() <= kFarthest || (other != nullptr && m.squared_error(*other) <= kFarthest))
      matches.push_back(m);
  }
  return matches;
}

using Labels = std::vector<uint8_t>;  // per match: of which motion it is

// The nearer of the matches as one motion and the farther ones as the other, in each of the ways in which a search
// begins. None where it saves less than a body must, to let each have its own, in all of them.
std::vector<Labels> near_and_far(const std::vector<Match>& matches) {
  std::vector<double> depth;
  depth.reserve(matches.size());
  for (const Match& m : matches) depth.push_back(m.depth);
  std::array<double, kQuarters - 1> limit;
  for (size_t k = 0; k < limit.size(); ++k) {
    const auto at = depth.begin() + static_cast<std::ptrdiff_t>((k + 1) * depth.size() / kQuarters);
    std::nth_element(depth.begin(), at, depth.end());
    limit[k] = *at;
  }
  std::array<Normal, kQuarters> quarter;
  for (const Match& m : matches) {
    const auto q = static_cast<size_t>(std::upper_bound(limit.begin(), limit.end(), m.depth) - limit.begin());
    quarter[q].add(student_weight(m.error.squaredNorm()), m.normal());
  }
  double saved = 0;
  for (size_t k = 0; k < limit.size(); ++k) {
    std::array<Normal, 2> side{any_motion(), any_motion()};
    for (size_t q = 0; q < kQuarters; ++q) side[q <= k].add(1, quarter[q]);
    saved = std::max(saved, -side[0].g.dot(side[0].solve()) - side[1].g.dot(side[1].solve()));
  }
  std::vector<Labels> ways;
  if (saved < kMoves * kSmallest * static_cast<double>(matches.size())) return ways;
  for (double farthest : limit) {
    Labels& label = ways.emplace_back();
    label.reserve(matches.size());
    for (const Match& m : matches) label.push_back(m.depth < farthest);
  }
  return ways;
}

// Each of two motions, what is of which, and what all of it costs.
struct TwoMotions {
  Labels label;
  std::array<Vector6d, 2> motion{Vector6d::Zero(), Vector6d::Zero()};  // perturbations of the pose, [m, rad]
  double cost = 0;

  double count(uint8_t of) const { return static_cast<double>(std::count(label.begin(), label.end(), of)); }
};

// What a sum is over: the matches of one motion.
struct Part {
  const Labels& label;
  uint8_t of;
};

class MotionProblem {
 public:
  MotionProblem(const std::vector<Match>& matches, std::span<const PoseObservation> observations, double width)
      : matches_(matches) {
    normal_.reserve(matches_.size());
    for (const Match& m : matches_) normal_.push_back(m.normal());
    find_neighbours(observations, width);
  }

  // That fits best, sought from `motion` on.
  Vector6d fit(const Part& part, Vector6d motion, int steps) const {
    for (int step = 0; step < steps; ++step) {
      Normal sum = any_motion();
      for (size_t i = 0; i < matches_.size(); ++i)
        if (part.label[i] == part.of) sum.add(student_weight(matches_[i].squared_error(motion)), normal_[i]);
      motion = sum.solve();
    }
    return motion;
  }
  double cost(const Part& part, const Vector6d& motion) const {
    double sum = 0;
    for (size_t i = 0; i < matches_.size(); ++i)
      if (part.label[i] == part.of) sum += cost_of(matches_[i].squared_error(motion));
    return sum;
  }

  // Nothing where one of the motions is left with too few matches.
  std::optional<TwoMotions> two_motions(Labels first) const {
    TwoMotions both;
    both.label = std::move(first);
    std::vector<std::array<double, 2>> cost(matches_.size());
    for (int round = 0; round < kRounds; ++round) {
      if (std::min(both.count(0), both.count(1)) < kSmallest * static_cast<double>(matches_.size()))
        return std::nullopt;
      for (uint8_t m : {0, 1}) {
        both.motion[m] = fit({both.label, m}, both.motion[m], 2);
        for (size_t i = 0; i < matches_.size(); ++i) cost[i][m] = cost_of(matches_[i].squared_error(both.motion[m]));
      }
      Labels next(matches_.size());
      for (size_t i = 0; i < matches_.size(); ++i)
        next[i] = cost[i][1] + kApart * apart(both.label, i, 1) < cost[i][0] + kApart * apart(both.label, i, 0);
      const bool settled = next == both.label;
      both.label = std::move(next);
      if (settled) break;
    }
    for (size_t i = 0; i < matches_.size(); ++i)
      both.cost += cost[i][both.label[i]] + kApart * apart(both.label, i, both.label[i]);
    return both;
  }

 private:
  void find_neighbours(std::span<const PoseObservation> observations, double width) {
    std::vector<Eigen::Vector3d> place;
    place.reserve(matches_.size());
    for (const Match& m : matches_) place.push_back(place_in_view(observations[m.observation].pixel, m.depth, width));
    neighbours_.resize(place.size());
    for (size_t i = 0; i < place.size(); ++i) {
      std::array<double, kNeighbours> nearest;  // squared distances, rising
      nearest.fill(std::numeric_limits<double>::infinity());
      for (size_t k = 0; k < place.size(); ++k) {
        const double distance = (place[k] - place[i]).squaredNorm();
        if (distance >= nearest.back() || k == i) continue;
        size_t at = kNeighbours - 1;
        for (; at > 0 && distance < nearest[at - 1]; --at) {
          nearest[at] = nearest[at - 1];
          neighbours_[i][at] = neighbours_[i][at - 1];
        }
        nearest[at] = distance;
        neighbours_[i][at] = static_cast<uint32_t>(k);
      }
    }
  }
  // Neighbours that are not of that motion.
  double apart(const Labels& label, size_t i, uint8_t of) const {
    double count = 0;
    for (uint32_t k : neighbours_[i]) count += label[k] != of;
    return count;
  }

  const std::vector<Match>& matches_;
  std::vector<Normal> normal_;
  std::vector<std::array<uint32_t, kNeighbours>> neighbours_;
};

// The motion of the room. A body that takes the camera along is near.
uint8_t of_most_surface(const TwoMotions& both, const std::vector<Match>& matches) {
  std::array<double, 2> surface{};
  for (size_t i = 0; i < matches.size(); ++i) surface[both.label[i]] += surface_around(matches[i].depth);
  return surface[1] > surface[0];
}

}  // namespace

std::optional<SecondMotion> second_motion(const CameraModel& camera, const Rigid3& cam_from_world,
                                          std::span<const PoseObservation> observations, int min_still,
                                          const PosePrior* expected, const Rigid3* other) {
  Vector6d to_other = Vector6d::Zero();
  if (other != nullptr) to_other = tangent_from_rigid3(cam_from_world * other->inverse());
  const std::vector<Match> matches =
      matches_of(camera, cam_from_world, observations, other != nullptr ? &to_other : nullptr);
  if (matches.size() < std::max(static_cast<size_t>(min_still), 2 * kNeighbours)) return std::nullopt;
  std::vector<Labels> ways = near_and_far(matches);
  if (other != nullptr) {
    Labels& label = ways.emplace_back();
    for (const Match& m : matches) label.push_back(m.squared_error(to_other) < m.error.squaredNorm());
  }
  if (ways.empty()) return std::nullopt;
  const MotionProblem problem(matches, observations, camera.width);
  std::optional<TwoMotions> both;
  for (Labels& way : ways) {
    auto found = problem.two_motions(std::move(way));
    if (found && (!both || found->cost < both->cost)) both = std::move(found);
  }
  if (!both) return std::nullopt;

  const uint8_t of_camera = of_most_surface(*both, matches);
  // How far points are whose depth is not measured the map may be wrong about: they go along with many a motion.
  int measured = 0;
  for (size_t i = 0; i < matches.size(); ++i)
    measured += both->label[i] == of_camera && observations[matches[i].observation].depth > 0;
  const double still = both->count(of_camera);
  if (still < min_still || measured < std::min(still / 2, static_cast<double>(min_still))) return std::nullopt;
  const auto squared_distance = [&](const Vector6d& motion) {
    if (expected == nullptr) return 0.0;
    const Vector6d d = tangent_from_rigid3(cam_from_world * expected->cam_from_world.inverse()) - motion;
    return d.dot(expected->information * d);
  };
  const auto unexpected = [&](const Vector6d& motion) {
    return (kStudentFreedom + 6) * std::log1p(squared_distance(motion) / kStudentFreedom);
  };
  const Labels one(matches.size(), 0);
  const Vector6d motion_of_one = problem.fit({one, 0}, Vector6d::Zero(), 4);
  const double cost_of_one = problem.cost({one, 0}, motion_of_one) + unexpected(motion_of_one);
  const double cost_of_two = both->cost + kMoves * both->count(1 - of_camera) + unexpected(both->motion[of_camera]);
  if (cost_of_two >= cost_of_one) return std::nullopt;
  const double of_parameters = 6 * std::log(static_cast<double>(matches.size()));
  SecondMotion second;
  second.moves.assign(observations.size(), 0);
  second.cam_from_world = rigid3_from_tangent(both->motion[of_camera]).inverse() * cam_from_world;
  second.sure = cost_of_one - cost_of_two > of_parameters;
  for (size_t i = 0; i < matches.size(); ++i) second.moves[matches[i].observation] = both->label[i] != of_camera;
  if (expected != nullptr)
    second.expected_weight = (kStudentFreedom + 6) / (kStudentFreedom + squared_distance(both->motion[of_camera]));
  return second;
}

bool near_and_far_differ(const CameraModel& camera, const Rigid3& cam_from_world,
                         std::span<const PoseObservation> observations) {
  const std::vector<Match> matches = matches_of(camera, cam_from_world, observations);
  return matches.size() >= 2 * kNeighbours && !near_and_far(matches).empty();
}

}  // namespace dkb
