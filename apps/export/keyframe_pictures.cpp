// SPDX-License-Identifier: Apache-2.0
#include "export/keyframe_pictures.h"

#include <algorithm>
#include <map>
#include <string>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/dynamics/silhouette.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"
#include "export/map_model.h"
#include "interrupt.h"

namespace dkb {
namespace {

// People who stand still are fit to track by, but no part of the still world: as for the dense map, whoever a detector
// names is left out.
GreyImage still_world(const FrameResult& result, const DepthImage& depth, const Camera& camera) {
  MoverMask movers = result.mask;
  unite(movers, silhouettes(depth, result.detections, camera, {}).mask, depth.width(), depth.height());
  GreyImage mask(depth.width(), depth.height(), 255);
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      if (movers.at(static_cast<float>(x), static_cast<float>(y))) mask(x, y) = 0;
  return mask;
}

}  // namespace

std::vector<KeyframeId> write_keyframe_pictures(const MapFile& file, Source& source, Slam& slam, MaskNames names,
                                                const std::filesystem::path& folder) {
  std::map<int64_t, KeyframeId> wanted;  // by stamp [us]
  for (KeyframeId id : keyframes_of_largest_map(file.map)) {
    wanted.emplace(ns_from_seconds(file.map.keyframe(id)->timestamp) / 1000, id);
  }
  make_output_folder(folder / "images");
  make_output_folder(folder / "masks");
  std::vector<KeyframeId> written;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next()) {
    Interrupt::check();
    if (next.state != SourceState::frame) continue;
    const FrameResult result = slam.process(next.frame);
    const auto keyframe = wanted.find(ns_from_seconds(seconds_from_ns(next.frame.stamp_ns())) / 1000);
    if (keyframe == wanted.end()) continue;
    const std::string picture = picture_name(*file.map.keyframe(keyframe->second));
    const RgbdImage& image = *next.frame.image();
    write_image_file(folder / "images" / picture,
                     image.colour.empty() ? encode_png(image.grey) : encode_png(image.colour));
    const std::string mask = picture + (names == MaskNames::with_ending ? ".png" : "");
    write_image_file(folder / "masks" / mask, encode_png(still_world(result, image.depth, slam.camera())));
    written.push_back(keyframe->second);
  }
  if (written.empty())
    throw InputError(source.description() + ": holds no frame of the map's " + std::to_string(wanted.size()) +
                     " keyframes; give the recording that the map was made from");
  std::sort(written.begin(), written.end());
  return written;
}

}  // namespace dkb
