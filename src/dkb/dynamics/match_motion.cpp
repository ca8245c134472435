// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/match_motion.h"

#include <vector>

#include "dkb/geometry/view_place.h"

namespace dkb {

MoverMask moving_cells(const Image<float>& depth, int cell, std::span<const MatchMotion> matches) {
  MoverMask mask{cell, Image<uint8_t>(depth.width(), depth.height())};
  const double width = cell * depth.width();
  std::vector<Eigen::Vector3d> places;
  places.reserve(matches.size());
  for (const MatchMotion& m : matches) places.push_back(place_in_view(m.image_pixel.cast<double>(), m.depth, width));
  for (int y = 0; y < depth.height(); ++y)
    for (int x = 0; x < depth.width(); ++x) {
      if (!(depth(x, y) > 0)) continue;
      const Eigen::Vector3d at = place_in_view({cell * (x + 0.5), cell * (y + 0.5)}, depth(x, y), width);
      double nearest = 1;  // squared
      bool moves = false;
      for (size_t i = 0; i < places.size(); ++i) {
        const double distance = (places[i] - at).squaredNorm();
        if (!(distance < nearest)) continue;  // nor where a point is not before the camera
        nearest = distance;
        moves = matches[i].moves;
      }
      if (moves) mask.cells(x, y) = 255;
    }
  return mask;
}

}  // namespace dkb
