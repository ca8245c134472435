// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/assignment.h"

#include <algorithm>
#include <limits>

namespace dkb {

std::vector<int> assign(const Eigen::MatrixXd& cost, double unassigned) {
  const auto rows = static_cast<int>(cost.rows()), real_columns = static_cast<int>(cost.cols());
  const int columns = real_columns + rows;  // one more per row stands for "none"
  const auto entry = [&](int r, int c) { return c < real_columns ? std::min(cost(r, c), unassigned) : unassigned; };
  const auto at = [](auto& v, int i) -> auto& {
    return v[static_cast<size_t>(i)];
  };
  const auto size = static_cast<size_t>(columns) + 1;
  // Rows join one by one along the cheapest alternating path. Rows and columns count from 1; 0 is nobody.
  std::vector<double> row_potential(static_cast<size_t>(rows) + 1, 0), column_potential(size, 0);
  std::vector<int> row_of(size, 0), previous(size, 0);
  for (int r = 1; r <= rows; ++r) {
    row_of[0] = r;
    int column = 0;
    std::vector<double> slack(size, std::numeric_limits<double>::infinity());
    std::vector<char> visited(size, 0);
    do {
      at(visited, column) = 1;
      const int row = at(row_of, column);
      double min_slack = std::numeric_limits<double>::infinity();
      int next = 0;
      for (int c = 1; c <= columns; ++c) {
        if (at(visited, c)) continue;
        const double reduced = entry(row - 1, c - 1) - at(row_potential, row) - at(column_potential, c);
        if (reduced < at(slack, c)) {
          at(slack, c) = reduced;
          at(previous, c) = column;
        }
        if (at(slack, c) < min_slack) {
          min_slack = at(slack, c);
          next = c;
        }
      }
      for (int c = 0; c <= columns; ++c) {
        if (at(visited, c)) {
          at(row_potential, at(row_of, c)) += min_slack;
          at(column_potential, c) -= min_slack;
        } else {
          at(slack, c) -= min_slack;
        }
      }
      column = next;
    } while (at(row_of, column) != 0);
    while (column != 0) {
      const int before = at(previous, column);
      at(row_of, column) = at(row_of, before);
      column = before;
    }
  }
  std::vector<int> column_of(static_cast<size_t>(rows), -1);
  for (int c = 1; c <= real_columns; ++c)
    if (const int r = at(row_of, c); r > 0 && cost(r - 1, c - 1) < unassigned) at(column_of, r - 1) = c - 1;
  return column_of;
}

}  // namespace dkb
