// SPDX-License-Identifier: Apache-2.0
// Orbbec's Gemini, Femto and Astra 2, by its SDK, version 2.
#include <algorithm>
#include <libobsensor/ObSensor.hpp>
#include <memory>
#include <stdexcept>
#include <string>

#include "dkb/devices/device_module.h"

namespace {

// Coefficients of these kinds are ours or can be turned into ours.
int lens_of(const OBCameraDistortion& lens) {
  const bool more = lens.k4 != 0 || lens.k5 != 0 || lens.k6 != 0;
  const bool straight = !more && lens.k1 == 0 && lens.k2 == 0 && lens.k3 == 0 && lens.p1 == 0 && lens.p2 == 0;
  switch (lens.model) {
    case OB_DISTORTION_BROWN_CONRADY:
    case OB_DISTORTION_BROWN_CONRADY_K6:
      return dkb_lens_forward;
    case OB_DISTORTION_INVERSE_BROWN_CONRADY:
      return more ? dkb_lens_other : dkb_lens_inverse;
    case OB_DISTORTION_KANNALA_BRANDT4:
      return dkb_lens_other;
    default:
      return straight ? dkb_lens_forward : dkb_lens_other;
  }
}

std::shared_ptr<ob::Device> find_device(ob::Context& context, const std::string& serial) {
  const std::shared_ptr<ob::DeviceList> devices = context.queryDeviceList();
  for (uint32_t i = 0; i < devices->getCount(); ++i)
    if (serial.empty() || serial == devices->getSerialNumber(i)) return devices->getDevice(i);
  return nullptr;
}

class Device {
 public:
  static std::vector<std::string> places() {
    const ob::Context context;
    const std::shared_ptr<ob::DeviceList> devices = context.queryDeviceList();
    std::vector<std::string> serials;
    for (uint32_t i = 0; i < devices->getCount(); ++i) serials.emplace_back(devices->getSerialNumber(i));
    return serials;
  }
  Device(const std::string& serial, const DkbDeviceMode& mode) : fps_(mode.fps) {
    const std::shared_ptr<ob::Device> device = find_device(context_, serial);
    if (device == nullptr)
      throw std::runtime_error(
          "Orbbec's SDK finds no such camera; is it plugged in? `dkb-slam sources` lists the cameras");
    serial_ = device->getDeviceInfo()->getSerialNumber();
    pipeline_ = std::make_unique<ob::Pipeline>(device);
    auto config = std::make_shared<ob::Config>();
    const auto width = static_cast<uint32_t>(mode.width), height = static_cast<uint32_t>(mode.height);
    const auto fps = static_cast<uint32_t>(mode.fps);
    config->enableVideoStream(OB_STREAM_COLOR, width, height, fps, OB_FORMAT_RGB);
    config->enableVideoStream(OB_STREAM_DEPTH, OB_WIDTH_ANY, OB_HEIGHT_ANY, fps, OB_FORMAT_Y16);
    config->setFrameAggregateOutputMode(OB_FRAME_AGGREGATE_OUTPUT_ALL_TYPE_FRAME_REQUIRE);
    pipeline_->enableFrameSync();
    pipeline_->start(config);
    // The unit of depth comes with the first frame.
    for (int i = 0; i < 20 && metres_per_unit_ == 0; ++i)
      if (const auto frames = pipeline_->waitForFrameset(500))
        if (const auto depth = frames->getDepthFrame())
          metres_per_unit_ = static_cast<double>(depth->getValueScale()) / 1000;
    if (metres_per_unit_ <= 0) throw std::runtime_error("Orbbec's SDK gives no images; plug the camera in again");
  }
  ~Device() {
    try {
      pipeline_->stop();
    } catch (const ob::Error&) {  // it is gone already
    }
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  std::string place() const { return serial_; }

  void describe(DkbDeviceCamera* camera) const {
    const OBCameraParam parameters = pipeline_->getCameraParam();
    const OBCameraIntrinsic& in = parameters.rgbIntrinsic;
    const OBCameraDistortion& lens = parameters.rgbDistortion;
    camera->width = in.width, camera->height = in.height, camera->fps = fps_;
    camera->depth_factor = dkb::depth_factor_of(metres_per_unit_);
    camera->lens = lens_of(lens);
    camera->fx = in.fx, camera->fy = in.fy, camera->cx = in.cx, camera->cy = in.cy;
    camera->k1 = lens.k1, camera->k2 = lens.k2, camera->p1 = lens.p1, camera->p2 = lens.p2, camera->k3 = lens.k3;
    camera->k4 = lens.k4, camera->k5 = lens.k5, camera->k6 = lens.k6;
  }

  int next(int timeout_ms, DkbDeviceImage* colour, DkbDeviceImage* depth) {
    const std::shared_ptr<ob::FrameSet> frames = pipeline_->waitForFrameset(static_cast<uint32_t>(timeout_ms));
    if (frames == nullptr) return find_device(context_, serial_) == nullptr ? dkb_unplugged : dkb_waiting;
    const std::shared_ptr<ob::Frame> aligned = align_.process(frames);
    if (aligned == nullptr) return dkb_waiting;
    frames_ = aligned->as<ob::FrameSet>();
    give(frames_->getColorFrame(), 3, dkb_rgb8, colour);
    give(frames_->getDepthFrame(), 2, dkb_depth_u16, depth);
    return dkb_images;
  }

 private:
  static void give(const std::shared_ptr<ob::VideoFrame>& frame, size_t bytes, int pixels, DkbDeviceImage* image) {
    if (frame == nullptr) return;
    *image = {frame->getData(),
              static_cast<int>(frame->getWidth()),
              static_cast<int>(frame->getHeight()),
              frame->getWidth() * bytes,
              pixels,
              static_cast<int64_t>(frame->getTimeStampUs()) * 1000};
  }

  ob::Context context_;
  std::string serial_;
  std::unique_ptr<ob::Pipeline> pipeline_;
  ob::Align align_{OB_STREAM_COLOR};
  std::shared_ptr<ob::FrameSet> frames_;
  int fps_ = 0;
  double metres_per_unit_ = 0;
};

// Its errors are no std::exception.
struct Calls {
  template <class Work>
  static auto run(const Work& work) {
    try {
      return work();
    } catch (const ob::Error& e) {
      throw std::runtime_error(e.getMessage());
    }
  }
};

}  // namespace

extern "C" const DkbDeviceApi* dkb_device_api_3() {
  return dkb::device_api<Device, Calls>();
}
