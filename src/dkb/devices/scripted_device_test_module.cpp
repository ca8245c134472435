// SPDX-License-Identifier: Apache-2.0
// For tests: cameras that are plugged in and out by a script. DKB_TEST_CAMERAS tells which one is the first at each
// attempt to open one, as SERIAL/WIDTH; those without a serial number cannot be told apart by it. Each gives two pairs,
// whose pixels are the first letter of its serial number, and is unplugged then.
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dkb/devices/device_module.h"

namespace {

constexpr int kHeight = 24;

std::vector<std::string> script() {
  const char* text = std::getenv("DKB_TEST_CAMERAS");
  std::istringstream words(text == nullptr ? "" : text);
  std::vector<std::string> cameras;
  for (std::string word; words >> word;) cameras.push_back(word);
  return cameras;
}

int attempts = 0;  // to open one
int64_t frames = 0;

class Device {
 public:
  static std::vector<std::string> places() {
    attempts = 0;  // a test begins
    return {};
  }
  Device(const std::string& serial, const DkbDeviceMode&) {
    const std::vector<std::string> cameras = script();
    const size_t first = static_cast<size_t>(attempts++);
    for (size_t i = 0; i < cameras.size(); ++i) {
      const std::string its_serial = cameras[i].substr(0, cameras[i].find('/'));
      if (serial.empty() ? i != first : its_serial != serial) continue;
      serial_ = its_serial;
      width_ = std::stoi(cameras[i].substr(its_serial.size() + 1));
      pixels_.assign(static_cast<size_t>(2 * width_ * kHeight), serial_.empty() ? 'x' : serial_[0]);
      return;
    }
    throw std::runtime_error("there is no such camera");
  }

  std::string place() const { return serial_; }

  void describe(DkbDeviceCamera* camera) const {
    camera->width = width_, camera->height = kHeight, camera->fps = 30, camera->depth_factor = 1000;
    camera->fx = camera->fy = 30, camera->cx = 15.5, camera->cy = 11.5;
  }

  int next(int, DkbDeviceImage* colour, DkbDeviceImage* depth) {
    if (pairs_++ == 2) return dkb_unplugged;
    const int64_t stamp = 33'000'000 * ++frames;
    const auto width = static_cast<size_t>(width_);
    *colour = {pixels_.data(), width_, kHeight, width, dkb_grey8, stamp};
    *depth = {pixels_.data(), width_, kHeight, 2 * width, dkb_depth_u16, stamp};
    return dkb_images;
  }

 private:
  std::string serial_;
  int width_ = 0, pairs_ = 0;
  std::vector<char> pixels_;
};

}  // namespace

extern "C" const DkbDeviceApi* dkb_device_api_3() {
  return dkb::device_api<Device>();
}
