// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

// The C interface between the library and the modules that hold the makers' libraries for their cameras: one module a
// maker, loaded when a camera of theirs is asked for. No exception crosses it: failures are texts written to `error`,
// always terminated.
extern "C" {

enum DkbDevicePixels { dkb_rgb8 = 0, dkb_bgr8 = 1, dkb_grey8 = 4, dkb_depth_u16 = 5 };  // as dkb::PixelFormat counts

struct DkbDeviceImage {
  const void* data;  // null = there is none; the device's, valid until its next call
  int width, height;
  size_t stride;  // [bytes]
  int pixels;     // DkbDevicePixels
  int64_t stamp_ns;
};

struct DkbDeviceCamera {
  int width, height;
  double fx, fy, cx, cy;  // [px]; fx 0 = the device does not tell
  double k1, k2, p1, p2, k3;
  double depth_factor;  // [units per metre]
  double fps;
};

enum DkbDeviceState { dkb_images = 1, dkb_waiting = 0, dkb_unplugged = -1, dkb_failed = -2 };

struct DkbDeviceApi {
  // Writes the places of the devices that are plugged in, a line each. Returns their number, or -1.
  int (*list)(char* lines, size_t lines_size, char* error, size_t error_size);
  // The place is a serial number or a URI; empty = the first device. Null when that fails.
  void* (*open)(const char* place, char* error, size_t error_size);
  void (*camera)(void* device, struct DkbDeviceCamera* camera);
  // Depth comes registered to colour. Returns a DkbDeviceState; images may come one at a time.
  int (*next)(void* device, int timeout_ms, struct DkbDeviceImage* colour, struct DkbDeviceImage* depth, char* error,
              size_t error_size);
  void (*close)(void* device);
};

// The one symbol looked up. The number in its name changes with the interface.
__attribute__((visibility("default"))) const struct DkbDeviceApi* dkb_device_api_1();

}  // extern "C"

// For the modules: runs `work`; an exception becomes `failure` and a text.
#include <cstdio>
#include <exception>

namespace dkb::module {

template <class Result, class Work>
Result guarded(Result failure, char* error, size_t error_size, const Work& work) {
  try {
    return work();
  } catch (const std::exception& e) {
    std::snprintf(error, error_size, "%s", e.what());
  } catch (...) {
    std::snprintf(error, error_size, "unknown failure");
  }
  return failure;
}

}  // namespace dkb::module
