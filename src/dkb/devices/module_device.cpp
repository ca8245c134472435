// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/module_device.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/paced_source.h"
#include "dkb/devices/device_module.h"
#include "dkb/devices/device_source.h"
#include "dkb/devices/told_camera.h"
#include "dkb/util/errors.h"
#include "dkb/util/module.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {

using Error = std::array<char, 512>;

const DkbDeviceApi* load(const DeviceModule& module, std::string* reason) {
  void* symbol = module_symbol({module.file, DKB_MODULE_LIBDIR, {DKB_MODULE_BUILD_DIR, DKB_MODULE_INSTALL_DIR}},
                               "dkb_device_api_3", reason);
  return symbol == nullptr ? nullptr : reinterpret_cast<const DkbDeviceApi* (*)()>(symbol)();
}

const DkbDeviceApi& api_of(const DeviceModule& module, const std::string& where) {
  std::string reason;
  if (const DkbDeviceApi* api = load(module, &reason)) return *api;
  throw InputError(where + ": " + why_no_module(module));
}

class ModuleDevice final : public ImageDevice {
 public:
  ModuleDevice(const DkbDeviceApi& api, std::string where, std::string place, const DkbDeviceMode& mode)
      : api_(api), where_(std::move(where)), place_(std::move(place)), mode_(mode) {
    Error error{};
    if (!open(&error)) throw InputError(where_ + ": " + one_line(error.data()));
    camera_ = camera();
    std::array<char, 256> lasting{};
    api_.place(device_, lasting.data(), lasting.size());
    if (place_.empty()) place_ = lasting.data();
  }
  ~ModuleDevice() override { close(); }
  ModuleDevice(const ModuleDevice&) = delete;
  ModuleDevice& operator=(const ModuleDevice&) = delete;

  DkbDeviceCamera camera() const {
    DkbDeviceCamera camera{};
    api_.camera(device_, &camera);
    return camera;
  }

  DeviceState next(int timeout_ms, DeviceImages* images) override {
    DkbDeviceImage colour{}, depth{};
    Error error{};
    const int state = api_.next(device_, timeout_ms, &colour, &depth, error.data(), error.size());
    if (state == dkb_failed) throw InputError(where_ + ": " + one_line(error.data()));
    if (state == dkb_unplugged) return DeviceState::unplugged;
    if (colour.data != nullptr) images->colour = image_of(colour);
    if (depth.data != nullptr) images->depth = image_of(depth);
    return images->colour || images->depth ? DeviceState::images : DeviceState::waiting;
  }

  bool reopen() override {
    close();
    Error error{};
    if (!open(&error)) return false;
    // Where devices have no lasting place, the first one may be another camera now.
    if (!place_.empty() || same_camera(camera(), camera_)) return true;
    close();
    return false;
  }

  std::string description() const override { return where_; }

 private:
  static DeviceImage image_of(const DkbDeviceImage& image) {
    return {{image.data, image.width, image.height, image.stride, static_cast<PixelFormat>(image.pixels)},
            image.stamp_ns};
  }
  static bool same_camera(const DkbDeviceCamera& a, const DkbDeviceCamera& b) {
    const auto numbers = [](const DkbDeviceCamera& c) {
      return std::array{c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5, c.k6, c.depth_factor};
    };
    return a.width == b.width && a.height == b.height && a.lens == b.lens && numbers(a) == numbers(b);
  }
  bool open(Error* error) {
    device_ = api_.open(place_.c_str(), &mode_, error->data(), error->size());
    return device_ != nullptr;
  }
  void close() {
    if (device_ != nullptr) api_.close(device_);
    device_ = nullptr;
  }

  const DkbDeviceApi& api_;
  const std::string where_;
  std::string place_;  // given, or that of the device that was opened first
  const DkbDeviceMode mode_;
  DkbDeviceCamera camera_{};  // of that device
  void* device_ = nullptr;
};

// That of the camera that will be used, where it is known already.
DkbDeviceMode wanted_mode(const SourceOptions& options) {
  DkbDeviceMode mode{640, 480, 30};
  std::optional<Camera> camera = options.fallback_camera;
  if (!options.camera.empty()) camera = choose_camera(options.camera, {}).camera;
  if (!camera) return mode;
  mode.width = camera->width, mode.height = camera->height;
  if (camera->fps > 0) mode.fps = std::max(1, static_cast<int>(std::lround(camera->fps)));
  return mode;
}

std::unique_ptr<Source> open_device(const DeviceModule& module, const std::string& where, const std::string& place,
                                    const SourceOptions& options) {
  auto device = std::make_unique<ModuleDevice>(api_of(module, where), where, place, wanted_mode(options));
  const ToldCamera told = told_camera(device->camera());
  const Camera camera = device_camera(where, told.camera, options, told.reason);
  return std::make_unique<DeviceSource>(std::move(device), camera, options);
}

}  // namespace

const DeviceModule& openni2_module() {
  static const DeviceModule module{"openni2", "libdkb_openni2.so", "OpenNI2", "install libopenni2-dev and build again"};
  return module;
}

const DeviceModule& realsense_module() {
  static const DeviceModule module{
      "realsense", "libdkb_realsense.so", "librealsense2",
      "install Intel's librealsense2 with its CMake package and build again, or use v4l2:COLOUR,DEPTH"};
  return module;
}

const DeviceModule& orbbec_module() {
  static const DeviceModule module{
      "orbbec", "libdkb_orbbec.so", "Orbbec's SDK",
      "install OrbbecSDK (version 2) with its CMake package and build again; older Orbbec cameras work as openni2"};
  return module;
}

std::string why_no_module(const DeviceModule& module) {
  std::string reason;
  if (load(module, &reason) != nullptr) return "";
  return "this build has no " + module.library + " (" + one_line(reason) + "); " + module.remedy;
}

std::vector<std::string> devices_of(const DeviceModule& module) {
  const DkbDeviceApi& api = api_of(module, module.scheme);
  std::array<char, 4096> lines{};
  Error error{};
  if (api.list(lines.data(), lines.size(), error.data(), error.size()) < 0)
    throw InputError(module.scheme + ": " + one_line(error.data()));
  std::vector<std::string> devices;
  std::string text = lines.data();
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    if (end > 0) devices.push_back(module.scheme + ":" + text.substr(0, end));
    text.erase(0, end + 1);
  }
  return devices;
}

std::unique_ptr<Source> open_module_device(const DeviceModule& module, const std::string& where,
                                           const SourceOptions& options) {
  const size_t colon = where.find(':');
  return PacedSource::of_device(
      open_device(module, where, colon == std::string::npos ? "" : where.substr(colon + 1), options));
}

}  // namespace dkb
