// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/depth_parts.h"

#include <algorithm>

#include "dkb/features/vectorised.h"

namespace dkb {

void link_cells(std::span<const float> depth, std::span<const float> jump, size_t step, uint8_t* linked, Simd simd) {
  if (depth.size() <= step) return;
  run_vectorised(simd, [d = depth.data(), j = jump.data(), n = depth.size() - step, step, linked]() DKB_KERNEL_BODY {
    DKB_INDEPENDENT_STEPS
    for (size_t i = 0; i < n; ++i) {
      const float a = d[i], b = d[i + step], low = a < b ? a : b, high = a < b ? b : a;
      const float allowed = a < b ? j[i] : j[i + step];
      linked[i] = (low > 0) & (high - low <= allowed);
    }
  });
}

DepthParts::DepthParts(int columns, int rows, Simd simd)
    : columns_(columns),
      rows_(rows),
      simd_(simd),
      right_(static_cast<size_t>(columns) * static_cast<size_t>(rows)),
      down_(right_.size()),
      run_above_(static_cast<size_t>(columns)) {}

void DepthParts::find_runs(std::span<const float> depth) {
  runs_.clear();
  joined_runs_.clear();
  for (int y = 0; y < rows_; ++y) {
    const size_t row = static_cast<size_t>(y) * static_cast<size_t>(columns_), first_of_row = runs_.size();
    const uint8_t* right = right_.data() + row;
    for (int x = 0; x < columns_;) {
      if (!(depth[row + static_cast<size_t>(x)] > 0)) {
        ++x;
        continue;
      }
      const size_t run = runs_.size();
      int end = x + 1;
      while (end < columns_ && right[end - 1]) ++end;
      runs_.push_back({y, x, end});
      joined_runs_.add();
      const uint8_t* up = y > 0 ? below(y - 1) : nullptr;
      size_t last = run;
      for (int c = x; up && c < end; ++c) {
        const size_t above = run_above_[static_cast<size_t>(c)];
        if (!up[c] || above == last) continue;
        last = above;
        joined_runs_.join(above, run);
      }
      x = end;
    }
    for (size_t r = first_of_row; r < runs_.size(); ++r)
      std::fill(run_above_.begin() + runs_[r].x0, run_above_.begin() + runs_[r].x1, r);
  }
}

// What lies outside the grid counts as linked.
size_t DepthParts::inner_of(const Run& run) const {
  const uint8_t* up = run.y > 0 ? below(run.y - 1) : nullptr;
  const uint8_t* down = run.y + 1 < rows_ ? below(run.y) : nullptr;
  size_t inner = 0;
  for (int x = run.x0 + (run.x0 > 0); x < run.x1 - (run.x1 < columns_); ++x)
    inner += (up == nullptr || up[x]) && (down == nullptr || down[x]);
  return inner;
}

std::vector<DepthPart> DepthParts::find(std::span<const float> depth, float share) {
  jump_.resize(depth.size());
  std::transform(depth.begin(), depth.end(), jump_.begin(), [share](float d) { return share * d; });
  return find(depth, jump_);
}

// The last cell of a row and the cells of the last row have links to cells that they have no neighbour in; nobody asks
// for those.
std::vector<DepthPart> DepthParts::find(std::span<const float> depth, std::span<const float> jump) {
  link_cells(depth, jump, 1, right_.data(), simd_);
  link_cells(depth, jump, static_cast<size_t>(columns_), down_.data(), simd_);
  find_runs(depth);
  std::vector<DepthPart> parts;
  std::vector<size_t> number(runs_.size());  // of the part that a first run begins
  for (size_t r = 0; r < runs_.size(); ++r) {
    const Run& run = runs_[r];
    const size_t first = joined_runs_.first_of(r);
    if (first == r) {
      number[r] = parts.size();
      parts.push_back({{run.x0, run.y, run.x1, run.y + 1}, {}, 0});
    }
    DepthPart& part = parts[number[first]];
    part.bounds = {std::min(part.bounds.x0, run.x0), part.bounds.y0, std::max(part.bounds.x1, run.x1), run.y + 1};
    part.inner += inner_of(run);
    for (int x = run.x0; x < run.x1; ++x) part.cells.push_back(static_cast<uint32_t>(run.y * columns_ + x));
  }
  return parts;
}

}  // namespace dkb
