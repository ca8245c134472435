// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/map_merge.h"

#include <algorithm>

#include "dkb/loop/global_adjustment.h"
#include "dkb/loop/loop_closer.h"
#include "dkb/mapping/local_mapper.h"

namespace dkb {

std::optional<MergedMaps> merge_maps(const Map& first, const Map& second, const Optics& optics,
                                     const SlamOptions& options) {
  MergedMaps result;
  Map both = first;
  both.append(second);
  const auto is_joined = [&](const Map& map) {
    const KeyframeId begin = first.keyframe_count();
    const std::vector<KeyframeId> root_of = map.root_of_each();
    return std::any_of(root_of.begin() + begin, root_of.end(), [begin](KeyframeId root) { return root < begin; });
  };
  LocalMapper mapper(optics, options.mapping, std::move(both));
  LoopOptions loop = options.loop_closing.loop;
  loop.min_support = std::min(loop.min_support, second.live_keyframe_count() - 1);  // short maps have few witnesses
  LoopCloser closer(optics, loop, options.seed);
  // The second map's keyframes one by one, as if its camera had just come by.
  KeyframeId seam = kNoKeyframe;
  for (KeyframeId id = first.keyframe_count(); id < mapper.map().keyframe_count(); ++id) {
    const auto correction = closer.process(mapper.map(), id);
    if (!correction) continue;
    ++(correction->kind == MapCorrection::Kind::merge ? result.merges : result.loops);
    mapper.apply(*correction);
    seam = id;
  }
  if (!is_joined(mapper.map())) return std::nullopt;
  mapper.apply(adjust_globally(mapper.map(), optics, options.mapping.ba, {seam}));
  result.map = mapper.map();
  return result;
}

}  // namespace dkb
