// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "dkb/solver/kernels.h"

namespace dkb::solver {

// Pattern of a symmetric matrix of 6x6 blocks: its lower triangle by columns. Column i holds the rows
// rows[first[i]] ... rows[first[i + 1] - 1], ascending, of which the first is i itself.
struct BlockPattern {
  std::vector<int> first;
  std::vector<int> rows;

  int size() const { return static_cast<int>(first.size()) - 1; }
};

// Cholesky factorisation of a positive definite matrix of 6x6 blocks, sparse by blocks; a full matrix is the special
// case of a full pattern. Left-looking by columns after an approximate-minimum-degree ordering (Davis, "Direct Methods
// for Sparse Linear Systems", chapter 4). Deterministic.
class BlockCholesky {
 public:
  BlockCholesky(const BlockPattern& pattern, const SolverKernels& kernels);

  // `blocks`: 36 numbers for each entry of the pattern, column by column (of the lower triangle's block).
  // False where the matrix is not positive definite.
  bool factorise(std::span<const double> blocks);
  // Solves for a right-hand side of 6 numbers per block row, in place. Needs a successful factorise().
  void solve(std::span<double> x) const;

 private:
  void order(const BlockPattern& pattern);
  void find_structure(const BlockPattern& pattern);
  bool factorise_column(int column);

  // One update of a column by an earlier one: the rows from `from` on of `column`.
  struct Update {
    int column, from;
  };

  const SolverKernels& kernels_;
  int size_ = 0;
  std::vector<int> new_of_old_;
  std::vector<int> first_, rows_;  // structure of the factor, by columns
  std::vector<double> factor_;     // 36 per entry; the diagonal's inverse pivots in pivots_
  std::vector<double> pivots_;     // 6 per column
  std::vector<int> update_first_;
  std::vector<Update> updates_;            // per column, from which earlier ones it takes
  std::vector<int> target_;                // per entry of the pattern: entry of the factor
  std::vector<unsigned char> transposed_;  // and whether the ordering mirrored it
  std::vector<int> position_;              // scratch: row -> entry of the column at work
};

}  // namespace dkb::solver
