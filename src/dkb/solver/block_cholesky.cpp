// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/block_cholesky.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace dkb::solver {
namespace {

// Below this a window is nearly full, and an ordering would not pay.
constexpr int kMinOrdered = 48;

// Lower Cholesky factor of a 6x6 block in place (column by column), with the inverses of its diagonal.
bool factorise_block(double* a, double* pivots) {
  for (int j = 0; j < 6; ++j) {
    double d = a[7 * j];
    for (int k = 0; k < j; ++k) d -= a[6 * k + j] * a[6 * k + j];
    // Relative to what stood there: what cancels to nothing is rounding, not information.
    if (!(d > 1e-15 * std::abs(a[7 * j])) || !std::isfinite(d)) return false;
    pivots[j] = 1.0 / std::sqrt(d);
    a[7 * j] = d * pivots[j];
    for (int i = j + 1; i < 6; ++i) {
      double s = a[6 * j + i];
      for (int k = 0; k < j; ++k) s -= a[6 * k + i] * a[6 * k + j];
      a[6 * j + i] = s * pivots[j];
    }
  }
  return true;
}

// x <- x L^-T for a 6x6 block.
void solve_block_right(double* x, const double* l, const double* pivots) {
  for (int j = 0; j < 6; ++j) {
    for (int k = 0; k < j; ++k) {
      const double f = l[6 * k + j];
      for (int i = 0; i < 6; ++i) x[6 * j + i] -= f * x[6 * k + i];
    }
    for (int i = 0; i < 6; ++i) x[6 * j + i] *= pivots[j];
  }
}

}  // namespace

BlockCholesky::BlockCholesky(const BlockPattern& pattern, const SolverKernels& kernels)
    : kernels_(kernels), size_(pattern.size()) {
  order(pattern);
  find_structure(pattern);
}

void BlockCholesky::order(const BlockPattern& pattern) {
  new_of_old_.resize(size_);
  std::iota(new_of_old_.begin(), new_of_old_.end(), 0);
  if (size_ < kMinOrdered) return;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(2 * pattern.rows.size());
  for (int column = 0; column < size_; ++column) {
    for (int k = pattern.first[column]; k < pattern.first[column + 1]; ++k) {
      entries.emplace_back(pattern.rows[k], column, 1.0);
      if (pattern.rows[k] != column) entries.emplace_back(column, pattern.rows[k], 1.0);
    }
  }
  Eigen::SparseMatrix<double> matrix(size_, size_);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> old_of_new;
  Eigen::AMDOrdering<int>()(matrix, old_of_new);
  for (int k = 0; k < size_; ++k) new_of_old_[old_of_new.indices()[k]] = k;
}

void BlockCholesky::find_structure(const BlockPattern& pattern) {
  std::vector<std::vector<int>> columns(size_);
  for (int old_column = 0; old_column < size_; ++old_column) {
    for (int k = pattern.first[old_column]; k < pattern.first[old_column + 1]; ++k) {
      const int a = new_of_old_[old_column], b = new_of_old_[pattern.rows[k]];
      columns[std::min(a, b)].push_back(std::max(a, b));
    }
  }
  // The rows of a column are its own and those of the columns whose first row below the diagonal it is.
  std::vector<std::vector<int>> children(size_);
  std::vector<int> seen(size_, -1);
  first_.assign(1, 0);
  for (int column = 0; column < size_; ++column) {
    std::vector<int> rows;
    const auto take = [&](int row) {
      if (seen[row] == column) return;
      seen[row] = column;
      rows.push_back(row);
    };
    take(column);
    for (const int row : columns[column]) take(row);
    for (const int child : children[column]) {
      for (int k = first_[child] + 1; k < first_[child + 1]; ++k) take(rows_[k]);
    }
    std::sort(rows.begin(), rows.end());
    if (rows.size() > 1) children[rows[1]].push_back(column);
    rows_.insert(rows_.end(), rows.begin(), rows.end());
    first_.push_back(static_cast<int>(rows_.size()));
  }

  update_first_.assign(size_ + 1, 0);
  for (int column = 0; column < size_; ++column) {
    for (int k = first_[column] + 1; k < first_[column + 1]; ++k) ++update_first_[rows_[k] + 1];
  }
  std::partial_sum(update_first_.begin(), update_first_.end(), update_first_.begin());
  updates_.resize(update_first_.back());
  std::vector<int> fill(update_first_.begin(), update_first_.end() - 1);
  for (int column = 0; column < size_; ++column) {
    for (int k = first_[column] + 1; k < first_[column + 1]; ++k) updates_[fill[rows_[k]]++] = {column, k};
  }

  target_.resize(pattern.rows.size());
  transposed_.resize(pattern.rows.size());
  for (int old_column = 0; old_column < size_; ++old_column) {
    for (int k = pattern.first[old_column]; k < pattern.first[old_column + 1]; ++k) {
      const int a = new_of_old_[old_column], b = new_of_old_[pattern.rows[k]];
      const int column = std::min(a, b), row = std::max(a, b);
      const auto begin = rows_.begin() + first_[column], end = rows_.begin() + first_[column + 1];
      target_[k] = static_cast<int>(std::lower_bound(begin, end, row) - rows_.begin());
      transposed_[k] = a > b;
    }
  }
  factor_.resize(static_cast<size_t>(kBlockSize) * rows_.size());
  pivots_.resize(static_cast<size_t>(6) * size_);
  position_.resize(size_);
}

bool BlockCholesky::factorise(std::span<const double> blocks) {
  std::fill(factor_.begin(), factor_.end(), 0.0);
  for (size_t k = 0; k < target_.size(); ++k) {
    const double* from = blocks.data() + kBlockSize * k;
    double* to = factor_.data() + static_cast<size_t>(kBlockSize) * target_[k];
    if (transposed_[k]) {
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) to[6 * i + j] = from[6 * j + i];
      }
    } else {
      std::copy_n(from, kBlockSize, to);
    }
  }
  for (int column = 0; column < size_; ++column) {
    if (!factorise_column(column)) return false;
  }
  return true;
}

bool BlockCholesky::factorise_column(int column) {
  for (int k = first_[column]; k < first_[column + 1]; ++k) position_[rows_[k]] = k;
  for (int u = update_first_[column]; u < update_first_[column + 1]; ++u) {
    const auto [earlier, from] = updates_[u];
    const double* own = factor_.data() + static_cast<size_t>(kBlockSize) * from;
    for (int k = from; k < first_[earlier + 1]; ++k) {
      kernels_.subtract_abt(factor_.data() + static_cast<size_t>(kBlockSize) * position_[rows_[k]],
                            factor_.data() + static_cast<size_t>(kBlockSize) * k, own);
    }
  }
  double* diagonal = factor_.data() + static_cast<size_t>(kBlockSize) * first_[column];
  double* pivots = pivots_.data() + 6 * static_cast<size_t>(column);
  if (!factorise_block(diagonal, pivots)) return false;
  for (int k = first_[column] + 1; k < first_[column + 1]; ++k) {
    solve_block_right(factor_.data() + static_cast<size_t>(kBlockSize) * k, diagonal, pivots);
  }
  return true;
}

void BlockCholesky::solve(std::span<double> x) const {
  std::vector<double> y(x.size());
  for (int i = 0; i < size_; ++i) std::copy_n(x.data() + 6 * i, 6, y.data() + 6 * new_of_old_[i]);
  for (int column = 0; column < size_; ++column) {
    const double* l = factor_.data() + static_cast<size_t>(kBlockSize) * first_[column];
    double* own = y.data() + 6 * column;
    for (int j = 0; j < 6; ++j) {
      own[j] *= pivots_[6 * column + j];
      for (int i = j + 1; i < 6; ++i) own[i] -= l[6 * j + i] * own[j];
    }
    for (int k = first_[column] + 1; k < first_[column + 1]; ++k) {
      const double* b = factor_.data() + static_cast<size_t>(kBlockSize) * k;
      double* to = y.data() + 6 * rows_[k];
      for (int j = 0; j < 6; ++j) {
        for (int i = 0; i < 6; ++i) to[i] -= b[6 * j + i] * own[j];
      }
    }
  }
  for (int column = size_ - 1; column >= 0; --column) {
    const double* l = factor_.data() + static_cast<size_t>(kBlockSize) * first_[column];
    double* own = y.data() + 6 * column;
    for (int k = first_[column] + 1; k < first_[column + 1]; ++k) {
      const double* b = factor_.data() + static_cast<size_t>(kBlockSize) * k;
      const double* from = y.data() + 6 * rows_[k];
      for (int j = 0; j < 6; ++j) {
        for (int i = 0; i < 6; ++i) own[j] -= b[6 * j + i] * from[i];
      }
    }
    for (int j = 5; j >= 0; --j) {
      for (int i = j + 1; i < 6; ++i) own[j] -= l[6 * j + i] * own[i];
      own[j] *= pivots_[6 * column + j];
    }
  }
  for (int i = 0; i < size_; ++i) std::copy_n(y.data() + 6 * new_of_old_[i], 6, x.data() + 6 * i);
}

}  // namespace dkb::solver
