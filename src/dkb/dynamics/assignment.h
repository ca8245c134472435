// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dkb {

// For each row of `cost` the column that it gets, -1 = none. Each column goes to one row at most; the total cost is the
// smallest possible, where a row left without a column costs `unassigned` and entries >= `unassigned` are never taken.
// Entries must not be NaN. Cubic time (Kuhn 1955, "The Hungarian method for the assignment problem"). Deterministic.
std::vector<int> assign(const Eigen::MatrixXd& cost, double unassigned);

}  // namespace dkb
