// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "dkb/dataset/image_codecs.h"
#include "dkb/image/image.h"

// One pair of functions per file format, behind image_codecs.h. All throw InputError `name: reason`.
namespace dkb::formats {

constexpr int kMaxSide = 16384;  // [px]

// Throws unless 1 <= width, height <= kMaxSide.
void require_side_lengths(int64_t width, int64_t height, const std::string& name);

ImageHeader png_header(std::string_view bytes, const std::string& name);
void decode_png(std::string_view bytes, const std::string& name, const ImageHeader& header, Picture* picture);
Image<uint16_t> decode_png16(std::string_view bytes, const std::string& name, const ImageHeader& header);

ImageHeader jpeg_header(std::string_view bytes, const std::string& name);
void decode_jpeg(std::string_view bytes, const std::string& name, Picture* picture);

ImageHeader tiff_header(std::string_view bytes, const std::string& name);
Image<float> decode_tiff(std::string_view bytes, const std::string& name);
ImageHeader pfm_header(std::string_view bytes, const std::string& name);
Image<float> decode_pfm(std::string_view bytes, const std::string& name);
ImageHeader npy_header(std::string_view bytes, const std::string& name);
Image<float> decode_npy(std::string_view bytes, const std::string& name);
Image<uint16_t> decode_npy16(std::string_view bytes, const std::string& name);

}  // namespace dkb::formats
