// SPDX-License-Identifier: Apache-2.0
#include "mover_evaluation.h"

#include <algorithm>
#include <map>
#include <set>

#include "dkb/util/errors.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

// True movers of one stamp, with the estimates that belong to them.
struct TrueFrame {
  double timestamp = 0;
  std::vector<const Mover*> movers;
  std::map<int, const Mover*> estimate_of;  // by true id
  size_t unmatched_estimates = 0;

  const Mover* find(int id) const {
    for (const Mover* m : movers)
      if (m->id == id) return m;
    return nullptr;
  }
  // 0 = no estimate.
  int estimated_id(int true_id) const {
    const auto it = estimate_of.find(true_id);
    return it == estimate_of.end() ? 0 : it->second->id;
  }
};

double median_or_zero(std::vector<double>& values) {
  return values.empty() ? 0 : upper_median(values);
}

std::vector<TrueFrame> frames_of(const MoverRows& truth) {
  std::vector<TrueFrame> frames;
  for (const MoverRow& row : truth) {
    if (frames.empty() || row.timestamp > frames.back().timestamp) frames.push_back({row.timestamp, {}, {}, 0});
    frames.back().movers.push_back(&row.mover);
  }
  return frames;
}

void match(const std::vector<const Mover*>& estimates, const Rigid3& truth_from_world, double match_distance,
           TrueFrame* frame) {
  struct Pair {
    double distance;
    const Mover *truth, *estimate;
  };
  std::vector<Pair> pairs;
  for (const Mover* e : estimates)
    for (const Mover* t : frame->movers) {
      const double distance = (truth_from_world * e->position_in_world - t->position_in_world).norm();
      if (distance <= match_distance) pairs.push_back({distance, t, e});
    }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::set<int> taken;
  for (const Pair& p : pairs)
    if (frame->estimate_of.count(p.truth->id) == 0 && taken.insert(p.estimate->id).second)
      frame->estimate_of[p.truth->id] = p.estimate;
  frame->unmatched_estimates = estimates.size() - taken.size();
}

// -1: a is left of b, 1: right of it, 0: their boxes share columns.
int side(const Mover& a, const Mover& b) {
  if (a.box.x + a.box.w <= b.box.x) return -1;
  return b.box.x + b.box.w <= a.box.x ? 1 : 0;
}

class CrossingCounter {
 public:
  CrossingCounter(const std::vector<TrueFrame>& frames, const MoverEvaluationOptions& options)
      : frames_(frames), options_(options) {}

  void count(int a, int b, MoverEvaluation* result) const {
    int last_side = 0;      // before they met; 0 = not known
    size_t last_apart = 0;  // frame of that
    bool meeting = false;
    double last_both = 0;  // [s] when both were last seen
    for (size_t i = 0; i < frames_.size(); ++i) {
      const Mover *ma = frames_[i].find(a), *mb = frames_[i].find(b);
      const double now = frames_[i].timestamp;
      if (ma == nullptr || mb == nullptr) {
        if (!meeting || now - last_both > options_.max_hidden) last_side = 0;
        if (last_side == 0) meeting = false;
        continue;
      }
      last_both = now;
      const int here = side(*ma, *mb);
      if (here == 0) {
        meeting = true;
        continue;
      }
      if (meeting && last_side != 0 && here != last_side)
        for (const int id : {a, b}) judge(id, last_apart, i, result);
      meeting = false;
      last_side = here;
      last_apart = i;
    }
  }

 private:
  void judge(int id, size_t before, size_t after, MoverEvaluation* result) const {
    int first = 0, second = 0;
    for (size_t i = before + 1;
         i-- > 0 && first == 0 && frames_[before].timestamp - frames_[i].timestamp <= options_.before_and_after;)
      first = frames_[i].estimated_id(id);
    for (size_t i = after; i < frames_.size() && second == 0 &&
                           frames_[i].timestamp - frames_[after].timestamp <= options_.before_and_after;
         ++i)
      second = frames_[i].estimated_id(id);
    if (first == 0) return;
    ++result->crossings;
    result->kept += first == second;
  }

  const std::vector<TrueFrame>& frames_;
  const MoverEvaluationOptions& options_;
};

}  // namespace

void MoverEvaluationOptions::check() const {
  require_option(match_distance > 0, "match_distance", match_distance, "greater than 0 m");
  require_option(same_stamp >= 0, "same_stamp", same_stamp, "at least 0 s");
  require_option(max_distance > 0, "max_distance", max_distance, "greater than 0 m");
  require_option(max_hidden > 0, "max_hidden", max_hidden, "greater than 0 s");
  require_option(before_and_after > 0, "before_and_after", before_and_after, "greater than 0 s");
}

MoverEvaluation evaluate_movers(const MoverRows& truth, const MoverRows& estimate, const Rigid3& truth_from_world,
                                const std::function<Eigen::Vector3d(double)>& camera_in_truth,
                                const MoverEvaluationOptions& options) {
  options.check();
  MoverEvaluation result;
  std::vector<TrueFrame> frames = frames_of(truth);
  std::vector<double> position_errors, velocity_errors;
  std::set<int> true_ids, given_ids;
  size_t within = 0, row = 0;
  double velocity_nees = 0;
  for (TrueFrame& frame : frames) {
    while (row < estimate.size() && estimate[row].timestamp < frame.timestamp - options.same_stamp) ++row;
    std::vector<const Mover*> estimates;
    for (; row < estimate.size() && estimate[row].timestamp <= frame.timestamp + options.same_stamp; ++row)
      estimates.push_back(&estimate[row].mover);
    match(estimates, truth_from_world, options.match_distance, &frame);
    result.false_movers += frame.unmatched_estimates;
    for (const Mover* t : frame.movers) {
      true_ids.insert(t->id);
      if (camera_in_truth && (camera_in_truth(frame.timestamp) - t->position_in_world).norm() > options.max_distance)
        continue;
      ++result.true_movers;
      const auto found = frame.estimate_of.find(t->id);
      if (found == frame.estimate_of.end()) continue;
      ++result.found;
      const Mover& e = *found->second;
      given_ids.insert(e.id);
      const Eigen::Vector3d off = truth_from_world * e.position_in_world - t->position_in_world;
      position_errors.push_back(off.norm());
      const double velocity_error = (truth_from_world.rotation * e.velocity_in_world - t->velocity_in_world).norm();
      velocity_errors.push_back(velocity_error);
      if (const double sd = velocity_sd(e); sd > 0) velocity_nees += velocity_error * velocity_error / (3 * sd * sd);
      for (int i = 0; i < 3; ++i) within += std::abs(off[i]) <= 2 * e.position_sd;
    }
  }
  result.ids = given_ids.size();
  result.median_position_error = median_or_zero(position_errors);
  result.median_velocity_error = median_or_zero(velocity_errors);
  if (result.found > 0) {
    const auto found = static_cast<double>(result.found);
    result.share_within_two_sd = static_cast<double>(within) / (3 * found);
    result.mean_velocity_nees = velocity_nees / found;
  }
  const CrossingCounter counter(frames, options);
  for (auto a = true_ids.begin(); a != true_ids.end(); ++a)
    for (auto b = std::next(a); b != true_ids.end(); ++b) counter.count(*a, *b, &result);
  return result;
}

}  // namespace dkb
