// SPDX-License-Identifier: Apache-2.0
// What devices and the texts beside published datasets give: the first byte tells which parser the rest is for.
#include <cstdint>
#include <string>
#include <vector>

#include "dkb/dataset/layout_cameras.h"
#include "dkb/devices/fake_device.h"
#include "dkb/devices/oni_codecs.h"
#include "dkb/devices/v4l2_device.h"
#include "dkb/devices/v4l2_formats.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const uint8_t* bytes = data + 1;
  const size_t count = size - 1;
  const std::string text(reinterpret_cast<const char*>(bytes), count);
  std::vector<uint8_t> scratch;
  try {
    switch (data[0] % 10) {
      case 0:
        dkb::parse_intrinsic_matrix(text, "intrinsic_color.txt", 640, 480);
        break;
      case 1:
        dkb::parse_replica_camera(text, "cam_params.json");
        break;
      case 2:
        dkb::parse_open3d_camera(text, "intrinsic.json");
        break;
      case 3:
        dkb::parse_openloris_camera(text, "sensors.yaml");
        break;
      case 4:
        dkb::parse_fake_place(text);
        break;
      case 5:
        dkb::parse_v4l2_place(text);
        break;
      case 6:
      case 7:
        dkb::decode_16z({bytes, count}, 256, data[0] % 10 == 6, "image");
        break;
      default:
        dkb::v4l2_image(data[0] % 10 == 8 ? dkb::V4l2Pixels::mjpeg : dkb::V4l2Pixels::yuyv, bytes, count, 16, 16, 0,
                        &scratch, "image");
    }
  } catch (const dkb::InputError&) {
  }
  return 0;
}
