// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/ba_layout.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "dkb/util/errors.h"

namespace dkb::solver {
namespace {

void require_index(int index, int count, const char* what) {
  if (index >= 0 && index < count) return;
  throw InputError(std::string("bundle adjustment: ") + what + " " + std::to_string(index) +
                   " does not exist; there are " + std::to_string(count));
}

}  // namespace

BaLayout::BaLayout(const BaProblem& problem)
    : cameras(static_cast<int>(problem.cam_from_world.size())), points(static_cast<int>(problem.points.size())) {
  check(problem);
  for (int c = 0; c < cameras; ++c) {
    free_of_camera.push_back(problem.fixed[c] ? -1 : static_cast<int>(camera_of_free.size()));
    if (!problem.fixed[c]) camera_of_free.push_back(c);
  }
  motions.emplace(problem.motions, free_of_camera);
  sort_observations(problem);
  number_pairs();
  find_blocks();
  motions->find_blocks(pattern);
}

void BaLayout::check(const BaProblem& problem) const {
  if (problem.fixed.size() != problem.cam_from_world.size()) {
    throw InputError("bundle adjustment: " + std::to_string(problem.fixed.size()) + " fixed flags for " +
                     std::to_string(cameras) + " cameras; give one per camera");
  }
  for (const BaObservation& o : problem.observations) {
    require_index(o.camera, cameras, "camera");
    require_index(o.point, points, "point");
  }
}

void BaLayout::sort_observations(const BaProblem& problem) {
  // Two stable counting sorts: by point, then by camera.
  const auto& observations = problem.observations;
  std::vector<int> by_point(observations.size());
  std::vector<int> next(points + 1, 0);
  for (const BaObservation& o : observations) ++next[o.point + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (size_t i = 0; i < observations.size(); ++i) by_point[next[observations[i].point]++] = static_cast<int>(i);

  camera_first.assign(cameras + 1, 0);
  for (const BaObservation& o : observations) ++camera_first[o.camera + 1];
  for (int c = 0; c < cameras; ++c) camera_first[c + 1] = camera_first[c] + (camera_first[c + 1] + 3) / 4 * 4;
  observation_of_entry.assign(camera_first.back(), -1);
  point_of_entry.assign(camera_first.back(), points);
  std::vector<int> fill(camera_first.begin(), camera_first.end() - 1);
  for (const int i : by_point) {
    const int entry = fill[observations[i].camera]++;
    observation_of_entry[entry] = i;
    point_of_entry[entry] = observations[i].point;
  }
}

void BaLayout::number_pairs() {
  pair_first.assign(points + 1, 0);
  const auto for_each_new_pair = [&](auto&& visit) {
    for (const int c : camera_of_free) {
      int previous = -1;
      for (int entry = camera_first[c]; entry < camera_first[c + 1]; ++entry) {
        const int point = point_of_entry[entry];
        if (point == points) break;
        visit(c, entry, point, point != previous);
        previous = point;
      }
    }
  };
  for_each_new_pair([&](int, int, int point, bool is_new) { pair_first[point + 1] += is_new ? 1 : 0; });
  std::partial_sum(pair_first.begin(), pair_first.end(), pair_first.begin());
  pair_camera.resize(pair_first.back());
  pair_of_entry.assign(point_of_entry.size(), pairs());
  std::vector<int> fill(pair_first.begin(), pair_first.end() - 1);
  for_each_new_pair([&](int c, int entry, int point, bool is_new) {
    if (is_new) pair_camera[fill[point]++] = free_of_camera[c];
    pair_of_entry[entry] = fill[point] - 1;
  });
}

void BaLayout::find_blocks() {
  block_first.assign(points + 1, 0);
  for (int p = 0; p < points; ++p) {
    const long long count = pair_first[p + 1] - pair_first[p];
    block_first[p + 1] = block_first[p] + count * (count + 1) / 2;
  }
  block.resize(block_first.back());
  const int n = free_cameras();
  const std::vector<std::vector<int>> joined = motions->later_neighbours();

  pattern.first.assign(1, 0);
  std::vector<int> seen(n, -1), block_of(n), rows;
  for (int i = 0; i < n; ++i) {
    rows.assign(1, i);
    seen[i] = i;
    const auto take = [&](int j) {
      if (seen[j] == i) return;
      seen[j] = i;
      rows.push_back(j);
    };
    for (const int j : joined[static_cast<size_t>(i)]) take(j);
    // Pairs of this camera, once each, with the pairs behind them of the same point.
    const int c = camera_of_free[i];
    const auto for_each_pair = [&](auto&& visit) {
      for (int entry = camera_first[c]; entry < camera_first[c + 1]; ++entry) {
        if (point_of_entry[entry] == points) break;
        if (entry == camera_first[c] || pair_of_entry[entry] != pair_of_entry[entry - 1]) {
          visit(point_of_entry[entry], pair_of_entry[entry]);
        }
      }
    };
    for_each_pair([&](int point, int pair) {
      for (int other = pair; other < pair_first[point + 1]; ++other) take(pair_camera[other]);
    });
    std::sort(rows.begin(), rows.end());
    for (const int row : rows) {
      block_of[row] = static_cast<int>(pattern.rows.size());
      pattern.rows.push_back(row);
    }
    pattern.first.push_back(static_cast<int>(pattern.rows.size()));
    for_each_pair([&](int point, int pair) {
      const long long a = pair - pair_first[point], count = pair_first[point + 1] - pair_first[point];
      int* target = block.data() + block_first[point] + a * count - a * (a - 1) / 2;
      for (int other = pair; other < pair_first[point + 1]; ++other) *target++ = block_of[pair_camera[other]];
    });
  }
}

}  // namespace dkb::solver
