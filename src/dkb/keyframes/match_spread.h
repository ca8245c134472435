// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace dkb {

// Matched points by cell of an image cut into 3 x 3 cells: counts[row][column], row 0 on top (G of DKB section 3.2).
using SpreadGrid = std::array<std::array<int, 3>, 3>;

// Counts `pixels` [px] of an image of the given size; those outside count to the cells at its rim.
SpreadGrid spread_grid(const std::vector<Eigen::Vector2f>& pixels, int width, int height);

int count_of(const SpreadGrid& grid);

// DKB eq. 38: how far apart the two fullest cells are and how equally full, 0 ... 1. Of equally full cells the first in
// row-major order counts. 0 when at most one cell holds points.
double centre_of_gravity_balance(const SpreadGrid& grid);

// DKB eqs. 39-41: distance of the centre of gravity from the grid's centre in cells, 0 ... sqrt(2). 0 for an empty
// grid.
double centre_of_gravity_offset(const SpreadGrid& grid);

struct SpreadVote {
  double ecog = 0;       // DKB eq. 38
  double threshold = 0;  // E_th, DKB eq. 41
  bool votes = false;    // for a keyframe: ecog > threshold; never for an empty grid
};

SpreadVote vote_by_spread(const SpreadGrid& grid);

}  // namespace dkb
