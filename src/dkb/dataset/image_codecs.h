// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "dkb/geometry/camera.h"
#include "dkb/image/image.h"

namespace dkb {

// Images in files. The kind of a file is told by its content, never by its name. Every function that reads throws
// InputError naming the file (`name`) and the reason; broken, foreign and hostile bytes do nothing worse. Sides are 1
// ... 16384 px.

enum class ImageKind { png, jpeg, tiff, pfm, npy };

struct ImageHeader {
  ImageKind kind = ImageKind::png;
  int width = 0, height = 0;  // [px]
  int channels = 1;           // as stored: 1 grey or palette, 2 grey + alpha, 3 colour, 4 colour + alpha
  int bits = 8;               // per channel; 8 also stands for 1, 2 and 4
  bool floating = false;      // float samples
  bool with_sign = false;     // of whole numbers
  bool palette = false;
};

// What the first bytes say; the pixels may still turn out to be broken.
ImageHeader read_image_header(std::string_view bytes, const std::string& name);

// A picture. 16-bit samples are scaled to 8 bits, alpha is ignored, palettes are resolved.
struct Picture {
  GreyImage grey;      // always there
  ColourImage colour;  // empty when the file holds grey only
};
Picture decode_picture(std::string_view bytes, const std::string& name);
Picture read_picture(const std::filesystem::path& path);

// The picture at another size: each pixel the mean of the area that it covers.
Picture resampled(const Picture& picture, int width, int height);

// A mask: 255 where a sample is above 0, however little of the range of its bits that is.
GreyImage read_mask(const std::filesystem::path& path);

// Depth [m], 0 = no data. 16-bit grey PNG and NumPy .npy of uint16: value / camera.depth_factor. 32-bit float (TIFF
// with one channel and without compression; PFM; NumPy .npy): metres. Values outside camera.depth_min ... depth_max and
// values that are not finite become 0. Any other type throws InputError.
DepthImage decode_depth(std::string_view bytes, const std::string& name, const CameraModel& camera);
DepthImage read_depth(const std::filesystem::path& path, const CameraModel& camera);

// Empty when a file of this header can be a depth image; otherwise what it is instead, e.g. "an 8-bit PNG".
std::string why_not_depth(const ImageHeader& header);
std::string depth_remedy(const ImageHeader& header);  // then: "; depth must be ..."
// The same for a picture.
std::string why_not_picture(const ImageHeader& header);

// Encoders. `compression`: zlib level 0 (none) ... 9 (smallest). JPEG quality: 1 ... 100, chroma at full size from 90.
std::string encode_png(const GreyImage& image, int compression = 6);
std::string encode_png(const ColourImage& image, int compression = 6);
std::string encode_png(const Image<uint16_t>& image, int compression = 6);
std::string encode_jpeg(const ColourImage& image, int quality = 95);
std::string encode_jpeg(const GreyImage& image, int quality = 95);
std::string encode_tiff(const Image<float>& image);  // no compression

// Plain write without the cost of fsync, for folders of thousands of images. Throws OutputError.
void write_image_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace dkb
