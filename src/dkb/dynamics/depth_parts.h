// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/util/disjoint_sets.h"

namespace dkb {

// Cells of a grid: columns x0 ... x1 - 1 of rows y0 ... y1 - 1.
struct CellBounds {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// Cells of a grid of depths that hang together.
struct DepthPart {
  CellBounds bounds;
  std::vector<uint32_t> cells;  // numbers of its cells, row by row
  size_t inner = 0;             // of them whose neighbours in the grid are all linked to them
};

// Whether each cell of a grid is on one surface with the one `step` further on: both have depth [m; 0 = none], and it
// differs by no more than what `jump` [m] allows the nearer one. `linked` has as many cells, of which the last `step`
// are left as they are. The bits do not depend on `simd`.
void link_cells(std::span<const float> depth, std::span<const float> jump, size_t step, uint8_t* linked,
                Simd simd = best_simd());

// Finds what hangs together in a grid of depths: neighbours, of which a cell has four, that are linked. Rows are cut
// into runs of linked cells, and runs that a link joins to the row above are united (Rosenfeld, Pfaltz 1966,
// "Sequential operations in digital picture processing"). Deterministic; the bits do not depend on `simd`.
class DepthParts {
 public:
  DepthParts(int columns, int rows, Simd simd = best_simd());

  // `depth` has columns * rows values [m], row by row, 0 = none; `jump` is for link_cells(). By the first cell of each
  // part.
  std::vector<DepthPart> find(std::span<const float> depth, std::span<const float> jump);
  // The same; depths may differ by a share of the smaller one.
  std::vector<DepthPart> find(std::span<const float> depth, float share);

 private:
  struct Run {
    int y, x0, x1;
  };
  void find_runs(std::span<const float> depth);
  size_t inner_of(const Run& run) const;
  const uint8_t* below(int y) const { return down_.data() + static_cast<size_t>(y) * static_cast<size_t>(columns_); }

  int columns_, rows_;
  Simd simd_;
  // Buffers, kept from grid to grid. Per cell: 1 = linked to its neighbour to the right, and below.
  std::vector<uint8_t> right_, down_;
  std::vector<float> jump_;
  std::vector<Run> runs_;
  DisjointSets joined_runs_;
  std::vector<size_t> run_above_;  // per column: the run of the row above
};

}  // namespace dkb
