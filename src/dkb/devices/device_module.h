// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "dkb/util/module_guard.h"

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

namespace dkb {

// Runs the calls of a maker's library as they are.
struct AsItIs {
  template <class Work>
  static auto run(const Work& work) {
    return work();
  }
};

// For the modules: the interface around a class that has places() (static: of the devices that are plugged in),
// Device(place), describe(camera) and next(timeout_ms, colour, depth). `Calls` runs what may throw; it turns what is no
// std::exception into one.
template <class Device, class Calls = AsItIs>
const DkbDeviceApi* device_api() {
  static const DkbDeviceApi api{
      [](char* lines, size_t lines_size, char* error, size_t error_size) {
        return guarded(-1, error, error_size, [&] {
          return Calls::run([&] {
            std::string text;
            const std::vector<std::string> places = Device::places();
            for (const std::string& place : places) text += place + "\n";
            std::snprintf(lines, lines_size, "%s", text.c_str());
            return static_cast<int>(places.size());
          });
        });
      },
      [](const char* place, char* error, size_t error_size) {
        return guarded<void*>(nullptr, error, error_size,
                              [&] { return Calls::run([&]() -> void* { return new Device(place); }); });
      },
      [](void* device, DkbDeviceCamera* camera) {  // a device that fails here tells nothing
        DkbDeviceCamera told{};
        char error[1];
        const auto describe = [&] { return static_cast<Device*>(device)->describe(&told), true; };
        if (guarded(false, error, sizeof error, [&] { return Calls::run(describe); })) *camera = told;
      },
      [](void* device, int timeout_ms, DkbDeviceImage* colour, DkbDeviceImage* depth, char* error, size_t error_size) {
        return guarded<int>(dkb_failed, error, error_size, [&] {
          return Calls::run([&]() -> int { return static_cast<Device*>(device)->next(timeout_ms, colour, depth); });
        });
      },
      [](void* device) { delete static_cast<Device*>(device); }};
  return &api;
}

}  // namespace dkb
