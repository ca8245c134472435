// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>

#include "dkb/image/rgbd_image.h"
#include "dkb/util/stamps.h"

namespace dkb {

// For tests: the frame of an image whose stamps are known to the microsecond.
inline Frame frame_of(std::shared_ptr<const RgbdImage> image) {
  const int64_t stamp = ns_from_seconds(image->timestamp), depth_stamp = ns_from_seconds(image->depth_timestamp);
  return Frame(std::move(image), stamp, depth_stamp);
}

}  // namespace dkb
