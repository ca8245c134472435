// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
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

// Which way the coefficients of a lens work.
enum DkbDeviceLens {
  dkb_lens_forward = 0,  // OpenCV's: k1 k2 p1 p2 k3 distort; with k4 k5 k6 the rational model
  dkb_lens_inverse = 1,  // k1 k2 p1 p2 k3 take the distortion away
  dkb_lens_other = 2     // a model that these coefficients do not hold
};

struct DkbDeviceCamera {
  int width, height;
  double fx, fy, cx, cy;  // [px]; fx 0 = the device does not tell
  double k1, k2, p1, p2, k3, k4, k5, k6;
  int lens;             // DkbDeviceLens
  double depth_factor;  // [units per metre]; 0 = the device does not tell
  double fps;
};

// The images that are wanted, of both streams.
struct DkbDeviceMode {
  int width, height;
  int fps;
};

enum DkbDeviceState { dkb_images = 1, dkb_waiting = 0, dkb_unplugged = -1, dkb_failed = -2 };

struct DkbDeviceApi {
  // Writes the places of the devices that are plugged in, a line each. Returns their number, or -1.
  int (*list)(char* lines, size_t lines_size, char* error, size_t error_size);
  // The place is a serial number or a URI; empty = the first device. Null when that fails.
  void* (*open)(const char* place, const struct DkbDeviceMode* mode, char* error, size_t error_size);
  void (*camera)(void* device, struct DkbDeviceCamera* camera);
  // The place by which this very device is found again when it has been unplugged, wherever it is plugged in; empty
  // where it has none.
  void (*place)(void* device, char* place, size_t place_size);
  // Depth comes registered to colour. Returns a DkbDeviceState; images may come one at a time.
  int (*next)(void* device, int timeout_ms, struct DkbDeviceImage* colour, struct DkbDeviceImage* depth, char* error,
              size_t error_size);
  void (*close)(void* device);
};

// The one symbol looked up. The number in its name changes with the interface.
__attribute__((visibility("default"))) const struct DkbDeviceApi* dkb_device_api_3();

}  // extern "C"

namespace dkb {

// Runs the calls of a maker's library as they are.
struct AsItIs {
  template <class Work>
  static auto run(const Work& work) {
    return work();
  }
};

// The makers tell units of depth as floats: 0.001F is meant to be 1000 to the metre, not 999.99995.
inline double depth_factor_of(double metres_per_unit) {
  if (!(metres_per_unit > 0)) return 0;
  const double factor = 1 / metres_per_unit, whole = std::round(factor);
  return std::abs(factor - whole) < 1e-6 * factor ? whole : factor;
}

// For the modules: the interface around a class that has places() (static: of the devices that are plugged in),
// Device(place, mode), describe(camera), place() and next(timeout_ms, colour, depth). `Calls` runs what may throw; it
// turns what is no std::exception into one.
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
      [](const char* place, const DkbDeviceMode* mode, char* error, size_t error_size) {
        return guarded<void*>(nullptr, error, error_size,
                              [&] { return Calls::run([&]() -> void* { return new Device(place, *mode); }); });
      },
      [](void* device, DkbDeviceCamera* camera) {  // a device that fails here tells nothing
        DkbDeviceCamera told{};
        char error[1];
        const auto describe = [&] { return static_cast<Device*>(device)->describe(&told), true; };
        if (guarded(false, error, sizeof error, [&] { return Calls::run(describe); })) *camera = told;
      },
      [](void* device, char* place, size_t place_size) {  // a device that fails here has none
        std::string told;
        char error[1];
        const auto ask = [&] { return told = static_cast<Device*>(device)->place(), true; };
        guarded(false, error, sizeof error, [&] { return Calls::run(ask); });
        std::snprintf(place, place_size, "%s", told.c_str());
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
