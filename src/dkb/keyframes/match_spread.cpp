// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/match_spread.h"

#include <algorithm>
#include <cmath>

namespace dkb {

SpreadGrid spread_grid(const std::vector<Eigen::Vector2f>& pixels, int width, int height) {
  SpreadGrid grid{};
  for (const Eigen::Vector2f& p : pixels) {
    const int column = static_cast<int>(std::floor(3 * p.x() / static_cast<float>(width)));
    const int row = static_cast<int>(std::floor(3 * p.y() / static_cast<float>(height)));
    ++grid[static_cast<size_t>(std::clamp(row, 0, 2))][static_cast<size_t>(std::clamp(column, 0, 2))];
  }
  return grid;
}

int count_of(const SpreadGrid& grid) {
  int sum = 0;
  for (const auto& row : grid)
    for (int cell : row) sum += cell;
  return sum;
}

double centre_of_gravity_balance(const SpreadGrid& grid) {
  struct Cell {
    int count, row, column;
  };
  Cell fullest{-1, 0, 0}, second{-1, 0, 0};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      const Cell cell{grid[static_cast<size_t>(r)][static_cast<size_t>(c)], r, c};
      if (cell.count > fullest.count) {
        second = fullest;
        fullest = cell;
      } else if (cell.count > second.count) {
        second = cell;
      }
    }
  if (fullest.count <= 0) return 0;
  const double distance = std::hypot(fullest.row - second.row, fullest.column - second.column);
  return distance * second.count / (2 * std::sqrt(2.0) * fullest.count);
}

double centre_of_gravity_offset(const SpreadGrid& grid) {
  const int sum = count_of(grid);
  if (sum == 0) return 0;
  int down = 0, right = 0;
  for (size_t i = 0; i < 3; ++i) {
    down += grid[2][i] - grid[0][i];
    right += grid[i][2] - grid[i][0];
  }
  return std::hypot(static_cast<double>(down) / sum, static_cast<double>(right) / sum);
}

SpreadVote vote_by_spread(const SpreadGrid& grid) {
  SpreadVote vote{centre_of_gravity_balance(grid), centre_of_gravity_offset(grid), false};
  vote.votes = count_of(grid) > 0 && vote.ecog > vote.threshold;
  return vote;
}

}  // namespace dkb
