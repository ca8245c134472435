// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/source.h"

namespace dkb {

struct V4l2Place {
  std::string colour, depth;  // /dev/video2
};

// `v4l2:COLOUR,DEPTH`; a number stands for /dev/videoNUMBER. Throws InputError.
V4l2Place parse_v4l2_place(const std::string& where);

// Two video devices of Linux as one camera: colour as YUYV, RGB24, BGR24, GREY or MJPEG, depth as Z16, both of the size
// of the camera that the options name, which they must. Stamps are the kernel's. Throws InputError.
std::unique_ptr<Source> open_v4l2_device(const std::string& where, const SourceOptions& options);

// A video device as it is found: where it is plugged in, and what it gives (fourcc).
struct V4l2Node {
  std::string path, bus;
  std::vector<uint32_t> formats;
};

// Those that give depth, by number, each with a colour device of the same camera where there is one: one that gives
// colours before one that gives grey alone, as infrared cameras do.
std::vector<std::string> v4l2_pairs(std::vector<V4l2Node> nodes);

// Those plugged in that give depth, each with a colour device of the same camera where there is one.
std::vector<std::string> v4l2_devices();

}  // namespace dkb
