// SPDX-License-Identifier: Apache-2.0
#include "export/keyframe_pictures.h"

#include <map>

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

int write_keyframe_pictures(const MapFile& file, Source& source, Slam& slam, MaskNames names,
                            const std::filesystem::path& folder) {
  std::map<int64_t, std::string> wanted;  // [us]
  for (KeyframeId id : keyframes_of_first_map(file.map)) {
    const Keyframe& k = *file.map.keyframe(id);
    wanted.emplace(ns_from_seconds(k.timestamp) / 1000, picture_name(k));
  }
  make_output_folder(folder / "images");
  make_output_folder(folder / "masks");
  int written = 0;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next()) {
    Interrupt::check();
    if (next.state != SourceState::frame) continue;
    const FrameResult result = slam.process(next.frame);
    const auto picture = wanted.find(ns_from_seconds(seconds_from_ns(next.frame.stamp_ns())) / 1000);
    if (picture == wanted.end()) continue;
    const RgbdImage& image = *next.frame.image();
    write_image_file(folder / "images" / picture->second,
                     image.colour.empty() ? encode_png(image.grey) : encode_png(image.colour));
    const std::string mask = picture->second + (names == MaskNames::with_ending ? ".png" : "");
    write_image_file(folder / "masks" / mask, encode_png(still_world(result, image.depth, slam.camera())));
    ++written;
  }
  if (written == 0)
    throw InputError(source.description() + ": holds no frame of the map's " + std::to_string(wanted.size()) +
                     " keyframes; give the recording that the map was made from");
  return written;
}

}  // namespace dkb
