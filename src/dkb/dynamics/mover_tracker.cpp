// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "dkb/dynamics/assignment.h"

namespace dkb {
namespace {

constexpr double kUnassigned = 50.0;  // above what fits: what can be explained is
constexpr const char* kUnnamed = "object";

// What follows was chosen on simulated crowds (tests/movers_test.cpp).
// Standard deviations of an observed position [m]: along the image's rows, along its columns, where clutter and other
// movers hide legs and bodies, and along the optical axis.
constexpr double kSdAcross = 0.12, kSdDown = 0.45, kSdDeep = 0.12;
constexpr double kSdNoDepth = 1.0;     // [m] the last where the sensor tells no depth
constexpr double kAgility = 3.0;       // [m^2/s^3] spectral density of the white noise that acceleration is taken for
constexpr double kFirstSpeedSd = 1.2;  // [m/s] standard deviation of the speed of something just found

constexpr double kGate = 25.0;              // squared Mahalanobis distance within which an observation may be a track's
constexpr double kMaxDistance = 0.9;        // [m] nor may it lie farther from where it is expected than this ...
constexpr double kMaxDistanceGrowth = 1.5;  // [m/s] ... and this times the time unseen
constexpr double kClassPenalty = 9.0;       // added to the squared distance when classes differ
constexpr double kBoxWeight = 2.0;          // times 1 - intersection over union with its last box: added too
constexpr double kBoxMemory = 0.3;          // [s] which counts less and less until so long ago

constexpr double kHasMoved = 0.5;      // [m] from where it was: it is asked whether it has left that place
constexpr double kBefore = 0.3;        // [m] what is so much nearer than a mover is not part of it
constexpr double kClaims = 0.1;        // [s] unseen for longer, a mover has no claim to surfaces where it is expected
constexpr double kMemory = 1.2;        // [s] a mover unseen for longer, and hidden by nothing, is forgotten
constexpr double kHiddenMemory = 5;    // [s] and one that is hidden: as long as one walks behind a group 7 m wide
constexpr double kDoubtMemory = 0.2;   // [s] the same before it is confirmed
constexpr int kMinObservations = 3;    // that confirm a mover and give it its id
constexpr double kApart = 0.35;        // [m] nothing is found so near to a mover already seen in the frame
constexpr double kRegionsApart = 0.6;  // [m] the same for regions without a box, across and along the optical axis

// Whether a box may be what is left of another one of the frame before.
bool left_of(const Box& before, const Box& now) {
  return 2 * shared_area(before, now) > now.area();
}

}  // namespace

void MoverTracker::predict(double seconds) {
  Covariance transition = Covariance::Identity();
  transition.topRightCorner<3, 3>() = seconds * Eigen::Matrix3d::Identity();
  Covariance noise = Covariance::Zero();
  noise.diagonal().head<3>().setConstant(seconds * seconds * seconds / 3);
  noise.diagonal().tail<3>().setConstant(seconds);
  noise.topRightCorner<3, 3>().diagonal().setConstant(0.5 * seconds * seconds);
  noise.bottomLeftCorner<3, 3>() = noise.topRightCorner<3, 3>();
  for (Track& t : tracks_) {
    if (!t.hidden || t.id == 0) t.missed += seconds;
    t.state.head<3>() += seconds * t.state.tail<3>();
    t.covariance = transition * t.covariance * transition.transpose() + kAgility * noise;
  }
}

void MoverSighting::move_to(const Rigid3& world_from_cam_found) {
  const Rigid3 found_from_expected = world_from_cam_found * world_from_cam.inverse();
  world_from_cam = world_from_cam_found;
  for (MoverObservation& o : observations) {
    o.position_in_world = found_from_expected * o.position_in_world;
    o.surface.move(found_from_expected);
  }
}

MoverSighting MoverTracker::look(double timestamp, const DepthImage& depth, const MoverMask& mask,
                                 std::span<const Detection> boxes, const Rigid3& world_from_cam_expected) {
  const double interval = std::max(0.0, timestamp - time_);
  predict(interval);
  time_ = timestamp;
  // What the frame before saw has not been missed yet, however long ago that was.
  const auto at_least = [&](double memory) { return std::max(memory, 1.5 * interval); };
  std::erase_if(tracks_, [&](const Track& t) {
    return t.missed > (t.id > 0 ? kMemory : at_least(kDoubtMemory)) || time_ - t.seen > at_least(kHiddenMemory);
  });
  MoverSighting sighting;
  // Tracks whose place is known well enough to tell whose surface is whose.
  std::vector<ExpectedMover> expected;
  for (size_t i = 0; i < tracks_.size(); ++i) {
    if (time_ - tracks_[i].seen > at_least(kClaims)) continue;
    expected.push_back({tracks_[i].state.head<3>(), tracks_[i].covariance.topLeftCorner<3, 3>()});
    sighting.tracks.push_back(i);
  }
  sighting.observations = observer_.observe(depth, mask, boxes, world_from_cam_expected, expected);
  sighting.world_from_cam = world_from_cam_expected;
  return sighting;
}

// Index of the observation of each track, -1 = none.
std::vector<int> MoverTracker::associate(const MoverSighting& sighting, const Eigen::Matrix3d& noise,
                                         const Eigen::Vector3d& down) const {
  const std::vector<MoverObservation>& observations = sighting.observations;
  const auto track_of = [&](const MoverObservation& o) { return sighting.tracks[static_cast<size_t>(o.expected)]; };
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(static_cast<Eigen::Index>(tracks_.size()),
                                                   static_cast<Eigen::Index>(observations.size()), kUnassigned);
  Eigen::MatrixXd boxes_alone = cost;
  const double noise_determinant = noise.determinant();
  std::vector<char> has_region(tracks_.size(), 0);
  for (const MoverObservation& o : observations)
    if (o.expected >= 0) has_region[track_of(o)] = 1;
  for (size_t i = 0; i < tracks_.size(); ++i) {
    const Track& t = tracks_[i];
    const Eigen::Matrix3d spread = t.covariance.topLeftCorner<3, 3>() + noise;
    const Eigen::Matrix3d information = spread.inverse();
    // A mover long unseen fits anywhere: half its log likelihood's width keeps it from taking what others fit better.
    const double width = 0.5 * std::log(spread.determinant() / noise_determinant);
    const double unseen = time_ - t.seen, max_distance = kMaxDistance + kMaxDistanceGrowth * t.missed;
    const double box_weight = kBoxWeight * std::max(0.0, 1 - unseen / kBoxMemory);
    for (size_t k = 0; k < observations.size(); ++k) {
      const MoverObservation& o = observations[k];
      const bool region = o.class_name.empty(), own = o.expected >= 0 && track_of(o) == i;
      if (region && !own && (o.expected >= 0 || has_region[i])) continue;
      if (!o.has_depth && (t.id == 0 || unseen > kBoxMemory || !left_of(t.box, o.box))) continue;
      const Eigen::Vector3d off = place(o, t) - t.state.head<3>();
      const double distance = off.dot(information * off), aside = (off - off.dot(down) * down).norm();
      if (distance > kGate || aside > max_distance) continue;
      double penalty = box_weight * (1 - static_cast<double>(intersection_over_union(t.box, o.box)));
      if (!o.class_name.empty() && !t.class_name.empty() && o.class_name != t.class_name) penalty += kClassPenalty;
      (o.has_depth ? cost : boxes_alone)(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          std::min(distance + width + penalty, 0.999 * kUnassigned);
    }
  }
  std::vector<int> found = assign(cost, kUnassigned);
  // Boxes without depth are left to movers that nothing else shows.
  for (size_t i = 0; i < tracks_.size(); ++i)
    if (found[i] >= 0) boxes_alone.row(static_cast<Eigen::Index>(i)).setConstant(kUnassigned);
  const std::vector<int> alone = assign(boxes_alone, kUnassigned);
  for (size_t i = 0; i < tracks_.size(); ++i)
    if (found[i] < 0) found[i] = alone[i];
  return found;
}

// Where an observation would be, were it the track's: of a box without depth, at the depth of the track.
Eigen::Vector3d MoverTracker::place(const MoverObservation& o, const Track& t) const {
  if (o.has_depth) return o.position_in_world;
  const double depth = (t.state.head<3>() - world_from_cam_.translation).dot(world_from_cam_.matrix3().col(2));
  return world_from_cam_.translation + depth * (o.position_in_world - world_from_cam_.translation);
}

void MoverTracker::correct(const MoverObservation& o, Eigen::Matrix3d noise, Track* t) {
  const Eigen::Vector3d axis = world_from_cam_.matrix3().col(2);
  if (!o.has_depth) noise += kSdNoDepth * kSdNoDepth * axis * axis.transpose();
  const Eigen::Matrix3d spread = t->covariance.topLeftCorner<3, 3>() + noise;
  const Eigen::Matrix<double, 6, 3> gain = t->covariance.leftCols<3>() * spread.inverse();
  t->state += gain * (place(o, *t) - t->state.head<3>());
  const Covariance less = gain * t->covariance.topRows<3>();
  t->covariance -= 0.5 * (less + less.transpose());
  t->hidden = false;
  if (o.has_depth) {
    t->seen = time_;
    t->missed = 0;
    t->size = o.size;
    t->position_sd = o.position_sd;
  }
  t->box = o.box;
  if (!o.class_name.empty()) t->class_name = o.class_name;
  if (++t->observations >= kMinObservations && t->id == 0) t->id = ++last_id_;
}

std::vector<Mover> MoverTracker::update(MoverSighting sighting, const DepthImage& depth, const Rigid3& world_from_cam) {
  world_from_cam_ = world_from_cam;
  sighting.move_to(world_from_cam);
  const std::vector<MoverObservation>& observations = sighting.observations;
  const Eigen::Vector3d sd(kSdAcross, kSdDown, kSdDeep);
  const Eigen::Matrix3d axes = world_from_cam.matrix3();
  const Eigen::Matrix3d noise = axes * sd.cwiseAbs2().asDiagonal() * axes.transpose();

  const std::vector<int> observation_of = associate(sighting, noise, axes.col(1));

  std::vector<Mover> movers;
  std::vector<char> taken(observations.size(), 0);
  std::vector<Eigen::Vector3d> seen;
  for (size_t i = 0; i < observation_of.size(); ++i) {
    Track& t = tracks_[i];
    const bool observed = observation_of[i] >= 0;
    MoverObservation o;
    if (observed) {
      const auto k = static_cast<size_t>(observation_of[i]);
      taken[k] = 1;
      o = observations[k];
    } else if (t.moved && t.surface.stands(depth, camera_, noise_, world_from_cam)) {
      o.box = t.surface.box_in(camera_, world_from_cam);
      o.position_in_world = t.surface.position_in_world;
      o.position_sd = t.position_sd;
      o.size = t.size;
    } else {
      t.hidden = stands_behind(t, depth);
      continue;
    }
    const Eigen::Vector3d position = place(o, t);
    correct(o, noise, &t);
    if (observed && o.has_depth) remember(o, depth, &t);
    seen.push_back(position);
    if (t.id == 0) continue;
    const double position_sd = o.has_depth ? o.position_sd : std::sqrt(t.covariance.topLeftCorner<3, 3>().trace() / 3);
    movers.push_back({t.id, t.class_name.empty() ? kUnnamed : t.class_name, position, t.state.tail<3>(), position_sd,
                      t.covariance, t.size, o.box});
  }
  for (size_t k = 0; k < observations.size(); ++k) {
    const MoverObservation& o = observations[k];
    if (taken[k] || o.expected >= 0 || !o.has_depth) continue;
    // Parts of one body may be taken for several regions, one above the other.
    const double apart = o.class_name.empty() ? kRegionsApart : kApart;
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
    t.covariance.diagonal().tail<3>().setConstant(kFirstSpeedSd * kFirstSpeedSd);
    t.seen = time_;
    t.box = o.box;
    t.observations = 1;
    t.before = o.surface;
    tracks_.push_back(std::move(t));
  }
  std::sort(movers.begin(), movers.end(), [](const Mover& a, const Mover& b) { return a.id < b.id; });
  return movers;
}

// Whether most of what can be seen where a mover is expected is nearer than it.
bool MoverTracker::stands_behind(const Track& t, const DepthImage& depth) const {
  const Eigen::Vector3d middle = world_from_cam_.inverse() * Eigen::Vector3d(t.state.head<3>());
  int seen = 0, nearer = 0;
  for (const double down : {-0.4, -0.2, 0.0, 0.2, 0.4})
    for (const double across : {-0.15, 0.0, 0.15}) {
      const Eigen::Vector3d p = middle + Eigen::Vector3d(across, down, 0);
      if (p.z() < kBefore) continue;
      const auto at = image_pixel(camera_, p);
      if (!at) continue;
      const int x = static_cast<int>(std::lround(at->x())), y = static_cast<int>(std::lround(at->y()));
      if (!depth.contains(x, y) || !(depth(x, y) > 0)) continue;
      ++seen;
      nearer += static_cast<double>(depth(x, y)) < p.z() - kBefore;
    }
  return 2 * nearer > seen;
}

void MoverTracker::remember(const MoverObservation& o, const DepthImage& depth, Track* t) const {
  // A detector tells of those who stand, too, and its boxes may hold what is behind somebody.
  if (!o.class_name.empty()) {
    t->surface = {};
    return;
  }
  // Where faults of the mask follow upon each other, their place changes, but what was seen there still stands there.
  if (!t->moved && t->id > 0 && (o.position_in_world - t->before.position_in_world).norm() > kHasMoved) {
    t->moved = t->before.has_left(depth, camera_, noise_, world_from_cam_);
    t->before = o.surface;
  }
  // The mask leaves who stands still piece by piece.
  if (2 * o.surface.area < t->surface.area && t->surface.stands(depth, camera_, noise_, world_from_cam_)) return;
  t->surface = o.surface;
}

void MoverTracker::rebase(const Rigid3& new_from_old) {
  Covariance rotation = Covariance::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() = new_from_old.matrix3();
  for (Track& t : tracks_) {
    t.before.move(new_from_old);
    t.surface.move(new_from_old);
    t.state.head<3>() = new_from_old * t.state.head<3>();
    t.state.tail<3>() = new_from_old.rotation * t.state.tail<3>();
    t.covariance = rotation * t.covariance * rotation.transpose();
  }
}

}  // namespace dkb
