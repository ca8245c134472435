// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "dkb/dataset/image_codecs.h"
#include "dkb/recordings/recording_file.h"

namespace dkb {

// A pair of images on its way into a folder or a recording.
struct PairToWrite {
  int64_t stamp_ns = 0, depth_stamp_ns = 0;
  std::string_view colour_file;       // a PNG or JPEG that is kept as it is; else empty, and
  const Picture* picture = nullptr;   // the pixels
  const DepthImage* depth = nullptr;  // [m], of any size above 0
};

struct PairWriterOptions {
  Compression compression = Compression::none;  // of a recording's chunks
  int png_level = 6;                            // of PNG files that are made for a folder, 0 ... 9
  std::function<void(const std::string&)> warn = [](const std::string&) {};
};

// Keeps pairs of images so that nothing is lost: the same frames are read from it, bit for bit. Readers of recordings
// pair images by their stamps: where these would pair others, depth gets the stamp of its colour image, and `warn` is
// told once. Throws OutputError.
class PairWriter {
 public:
  // Without close() nothing is left behind, and what has this name stays what it was.
  virtual ~PairWriter() = default;
  virtual void add(const PairToWrite& pair) = 0;
  virtual void close() = 0;
  // In the place of close(), after add() or close() has thrown since the disk is full: keeps what is whole, but for as
  // much of the end as lists or index take. Throws when nothing is.
  virtual void salvage() = 0;
};

// FILE.bag and FILE.mcap: the topics /camera/rgb/image_raw (or image_raw/compressed), /camera/depth/image_raw and
// /camera/rgb/camera_info of ROS, and /dkb_slam/camera with the camera file, which an mcap file also holds as a
// metadata record. Another name is that of a folder, which must be new or empty, in the layout of the TUM RGB-D
// benchmark. `camera_text`: the camera file, of which `camera` was read.
std::unique_ptr<PairWriter> write_pairs(const std::filesystem::path& path, const Camera& camera,
                                        const std::string& camera_text, const PairWriterOptions& options = {});

}  // namespace dkb
