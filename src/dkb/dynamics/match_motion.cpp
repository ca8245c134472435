// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/match_motion.h"

#include <algorithm>
#include <vector>

#include "dkb/geometry/view_place.h"

namespace dkb {

MoverMask moving_cells(const Image<float>& depth, int cell, std::span<const MatchMotion> matches) {
  const int columns = depth.width(), rows = depth.height();
  const double width = cell * columns;
  std::vector<Eigen::Vector3d> places;  // infinitely far without depth
  places.reserve(depth.size());
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x)
      places.push_back(place_in_view({cell * (x + 0.5), cell * (y + 0.5)}, depth(x, y), width));
  MoverMask mask{cell, Image<uint8_t>(columns, rows)};
  std::vector<double> nearest(places.size(), 1);                                             // squared
  const int reach = 1 + static_cast<int>(1 / place_in_view({1.0 * cell, 0}, 1, width).x());  // [cells]
  for (const MatchMotion& m : matches) {
    const Eigen::Vector3d at = place_in_view(m.image_pixel.cast<double>(), m.depth, width);
    const int u = static_cast<int>(m.image_pixel.x()) / cell, v = static_cast<int>(m.image_pixel.y()) / cell;
    for (int y = std::max(0, v - reach); y <= std::min(rows - 1, v + reach); ++y)
      for (int x = std::max(0, u - reach); x <= std::min(columns - 1, u + reach); ++x) {
        const size_t i = static_cast<size_t>(y) * static_cast<size_t>(columns) + static_cast<size_t>(x);
        const double distance = (places[i] - at).squaredNorm();
        if (!(distance < nearest[i])) continue;  // nor where the point is not before the camera
        nearest[i] = distance;
        mask.cells.data()[i] = m.moves ? 255 : 0;
      }
  }
  return mask;
}

}  // namespace dkb
