// SPDX-License-Identifier: Apache-2.0
// Cameras that OpenNI 2 drives: PrimeSense, Asus Xtion, Structure, the older Orbbec Astra.
#include <OpenNI.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>

#include "dkb/devices/device_module.h"

namespace {

using openni::OpenNI;

void require(openni::Status status, const std::string& what) {
  if (status == openni::STATUS_OK) return;
  std::string reason = OpenNI::getExtendedError();
  const size_t begin = reason.find_first_not_of(" \t\n"), end = reason.find_last_not_of(" \t\n");
  reason = begin == std::string::npos ? "" : reason.substr(begin, end + 1 - begin);
  throw std::runtime_error("OpenNI 2 " + what + (reason.empty() ? "" : " (" + reason + ")"));
}

// Started once and never shut down: that would unload the drivers, and threads of theirs may still run.
void start_library() {
  static const openni::Status status = OpenNI::initialize();
  require(status, "does not start");
}

class Device final : public OpenNI::DeviceDisconnectedListener {
 public:
  static std::vector<std::string> places() {
    start_library();
    openni::Array<openni::DeviceInfo> devices;
    OpenNI::enumerateDevices(&devices);
    std::vector<std::string> uris;
    for (int i = 0; i < devices.getSize(); ++i) uris.emplace_back(devices[i].getUri());
    return uris;
  }
  Device(const char* place, const DkbDeviceMode& mode) {
    start_library();
    const char* uri = *place == '\0' ? openni::ANY_DEVICE : place;
    require(device_.open(uri), "finds no such camera; is it plugged in? `dkb-slam sources` lists them");
    if (device_.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR))
      require(device_.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR),
              "cannot register depth to colour");
    device_.setDepthColorSyncEnabled(true);  // not every camera can
    require(colour_.create(device_, openni::SENSOR_COLOR), "gives no colour");
    require(depth_.create(device_, openni::SENSOR_DEPTH), "gives no depth");
    choose_modes(mode);
    colour_.setMirroringEnabled(false), depth_.setMirroringEnabled(false);
    OpenNI::addDeviceDisconnectedListener(this);
  }
  ~Device() override {
    OpenNI::removeDeviceDisconnectedListener(this);
    colour_frame_.release(), depth_frame_.release();
    if (started_) stop();
    depth_.destroy(), colour_.destroy();
    device_.close();
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void onDeviceDisconnected(const openni::DeviceInfo* info) override {
    if (std::string(info->getUri()) == device_.getDeviceInfo().getUri()) gone_ = true;
  }

  static std::string place() { return ""; }  // URIs name the port, and the system counts up what is plugged in

  void describe(DkbDeviceCamera* camera) const {
    const openni::VideoMode mode = colour_.getVideoMode();
    camera->width = mode.getResolutionX(), camera->height = mode.getResolutionY();
    camera->fps = mode.getFps();
    const double across = colour_.getHorizontalFieldOfView(), down = colour_.getVerticalFieldOfView();
    if (across > 0 && down > 0) {
      camera->fx = camera->width / (2 * std::tan(across / 2)), camera->fy = camera->height / (2 * std::tan(down / 2));
      camera->cx = (camera->width - 1) / 2.0, camera->cy = (camera->height - 1) / 2.0;
    }
    camera->depth_factor = depth_.getVideoMode().getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_100_UM ? 10000 : 1000;
  }

  int next(int timeout_ms, DkbDeviceImage* colour, DkbDeviceImage* depth) {
    // Not before images are wanted: some drivers do not survive being stopped as soon as they are started.
    if (!started_) {
      require(colour_.start(), "does not start colour");
      require(depth_.start(), "does not start depth");
      started_ = true;
    }
    openni::VideoStream* streams[] = {&colour_, &depth_};
    int ready = -1;
    const openni::Status status = OpenNI::waitForAnyStream(streams, 2, &ready, timeout_ms);
    if (gone_ || status == openni::STATUS_NO_DEVICE) return dkb_unplugged;
    if (status == openni::STATUS_TIME_OUT) return dkb_waiting;
    require(status, "gives no images");
    if (ready == 0) {
      require(colour_.readFrame(&colour_frame_), "gives no colour");
      give(colour_frame_, dkb_rgb8, colour);
    } else {
      require(depth_.readFrame(&depth_frame_), "gives no depth");
      give(depth_frame_, dkb_depth_u16, depth);
    }
    return dkb_images;
  }

 private:
  void stop() {
    depth_.stop(), colour_.stop();
    // Threads of some drivers go on for an image or two and must find their stream still there.
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
    for (;;) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      openni::VideoStream* streams[] = {&colour_, &depth_};
      int ready = -1;
      if (left.count() <= 0 ||
          OpenNI::waitForAnyStream(streams, 2, &ready, static_cast<int>(left.count())) != openni::STATUS_OK)
        break;
      openni::VideoFrameRef frame;
      streams[ready]->readFrame(&frame);
    }
  }

  // What is next to the wanted size and rate, both of one size.
  void choose_modes(const DkbDeviceMode& wanted) {
    const auto choose = [&](openni::VideoStream& stream, auto fits) {
      const openni::Array<openni::VideoMode>& modes = stream.getSensorInfo().getSupportedVideoModes();
      const openni::VideoMode* best = nullptr;
      const auto badness = [&](const openni::VideoMode& m) {
        return std::abs(m.getResolutionX() - wanted.width) + std::abs(m.getResolutionY() - wanted.height) +
               std::abs(m.getFps() - wanted.fps);
      };
      for (int i = 0; i < modes.getSize(); ++i)
        if (fits(modes[i]) && (best == nullptr || badness(modes[i]) < badness(*best))) best = &modes[i];
      if (best == nullptr) throw std::runtime_error("OpenNI 2 offers no RGB888 colour with depth of the same size");
      const openni::VideoMode now = stream.getVideoMode();
      // The only mode of some devices cannot be set.
      if (now.getResolutionX() != best->getResolutionX() || now.getResolutionY() != best->getResolutionY() ||
          now.getFps() != best->getFps() || now.getPixelFormat() != best->getPixelFormat())
        require(stream.setVideoMode(*best), "cannot set the size of the images");
    };
    const auto in_millimetres = [](const openni::VideoMode& m) {
      return m.getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_1_MM;
    };
    const openni::Array<openni::VideoMode>& depths = depth_.getSensorInfo().getSupportedVideoModes();
    choose(colour_, [&](const openni::VideoMode& m) {
      bool same = false;
      for (int i = 0; i < depths.getSize(); ++i)
        same |= in_millimetres(depths[i]) && depths[i].getResolutionX() == m.getResolutionX() &&
                depths[i].getResolutionY() == m.getResolutionY();
      return same && m.getPixelFormat() == openni::PIXEL_FORMAT_RGB888;
    });
    const openni::VideoMode colour = colour_.getVideoMode();
    choose(depth_, [&](const openni::VideoMode& m) {
      return in_millimetres(m) && m.getResolutionX() == colour.getResolutionX() &&
             m.getResolutionY() == colour.getResolutionY();
    });
  }

  static void give(const openni::VideoFrameRef& frame, int pixels, DkbDeviceImage* image) {
    *image = {frame.getData(),
              frame.getWidth(),
              frame.getHeight(),
              static_cast<size_t>(frame.getStrideInBytes()),
              pixels,
              static_cast<int64_t>(frame.getTimestamp()) * 1000};
  }

  openni::Device device_;
  openni::VideoStream colour_, depth_;
  openni::VideoFrameRef colour_frame_, depth_frame_;
  std::atomic<bool> gone_{false};
  bool started_ = false;
};

}  // namespace

extern "C" const DkbDeviceApi* dkb_device_api_3() {
  return dkb::device_api<Device>();
}
