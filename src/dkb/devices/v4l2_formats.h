// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dkb_slam/image.h"

namespace dkb {

// The pixels that video devices give, by their V4L2 names.
enum class V4l2Pixels { rgb24, bgr24, grey, yuyv, mjpeg, z16 };

// Nothing to us when it is not in the list. `fourcc` as V4L2 has it.
bool v4l2_pixels_of(uint32_t fourcc, V4l2Pixels* pixels);
uint32_t fourcc_of(V4l2Pixels pixels);

// An image of a buffer of `size` bytes, whose rows are `stride` bytes apart (0 = packed). What can be used as it is is
// looked at in place; YUYV (ITU-R BT.601, limited range) and MJPEG are converted into `scratch`. Throws InputError
// `name: reason` when the buffer holds less than the image, or a broken JPEG.
ImageView v4l2_image(V4l2Pixels pixels, const uint8_t* data, size_t size, int width, int height, size_t stride,
                     std::vector<uint8_t>* scratch, const std::string& name);

}  // namespace dkb
