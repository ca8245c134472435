// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>

#include "dkb/util/plural.h"

namespace dkb {

// Why frames have too few features to start a map, after "... has N features with depth", where the images or the
// detector are to blame; nothing where depth must be. `corners`: the most of a frame; `on_movers`: their share on what
// `detector` takes for movers.
inline std::string why_few_features(size_t corners, double on_movers, const std::string& detector, int wanted) {
  if (corners < static_cast<size_t>(wanted))
    return fmt::format("; the images show {} at most: are they black, covered or out of focus?",
                       plural(corners, "corner", "corners"));
  if (on_movers <= 0.5) return "";
  return fmt::format(
      " on what stands still: {:.0f}% of them lie on what the detector ({}) takes for movers; does it mark the still "
      "world?",
      100 * on_movers, detector);
}

}  // namespace dkb
