// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/block_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "dkb/util/random.h"

namespace dkb::solver {
namespace {

struct RandomSystem {
  BlockPattern pattern;
  std::vector<double> blocks;
  Eigen::MatrixXd matrix;

  RandomSystem(int n, double density, double diagonal, uint64_t seed) : matrix(Eigen::MatrixXd::Zero(6 * n, 6 * n)) {
    Random random(seed);
    pattern.first.push_back(0);
    for (int column = 0; column < n; ++column) {
      for (int row = column; row < n; ++row) {
        if (row != column && random.uniform() >= density) continue;
        Eigen::Matrix<double, 6, 6> block;
        for (int k = 0; k < 36; ++k) block.data()[k] = random.uniform(-1, 1);
        if (row == column) {
          block = (block + block.transpose()).eval();
          block.diagonal().array() += diagonal;
        }
        pattern.rows.push_back(row);
        blocks.insert(blocks.end(), block.data(), block.data() + 36);
        matrix.block<6, 6>(6 * row, 6 * column) = block;
        matrix.block<6, 6>(6 * column, 6 * row) = block.transpose();
      }
      pattern.first.push_back(static_cast<int>(pattern.rows.size()));
    }
  }
};

TEST(BlockCholesky, SolvesAsDenseFactorisationDoes) {
  struct Case {
    int n;
    double density;
  };
  for (const auto [n, density] : {Case{1, 1}, Case{15, 1}, Case{30, 0.3}, Case{90, 0.04}, Case{90, 0.5}}) {
    const RandomSystem system(n, density, 60.0 + 6 * n * density, 3);
    BlockCholesky cholesky(system.pattern, solver_kernels());
    Eigen::VectorXd b(6 * n);
    Random random(8);
    for (double& value : b) value = random.normal();
    for (int repeat = 0; repeat < 2; ++repeat) {  // a second factorisation must not see the first
      ASSERT_TRUE(cholesky.factorise(system.blocks));
      Eigen::VectorXd x = b;
      cholesky.solve({x.data(), static_cast<size_t>(x.size())});
      EXPECT_LT((x - system.matrix.ldlt().solve(b)).norm(), 1e-12 * x.norm() * 6 * n) << n;
    }
  }
}

TEST(BlockCholesky, RefusesWhatIsNotPositiveDefinite) {
  const RandomSystem system(5, 1, 0.0, 3);
  BlockCholesky cholesky(system.pattern, solver_kernels());
  EXPECT_FALSE(cholesky.factorise(system.blocks));
  const std::vector<double> zero(system.blocks.size(), 0.0);
  EXPECT_FALSE(cholesky.factorise(zero));
}

TEST(BlockCholesky, AnEmptySystemIsSolved) {
  BlockPattern pattern;
  pattern.first.push_back(0);
  BlockCholesky cholesky(pattern, solver_kernels());
  EXPECT_TRUE(cholesky.factorise({}));
  cholesky.solve({});
}

}  // namespace
}  // namespace dkb::solver
