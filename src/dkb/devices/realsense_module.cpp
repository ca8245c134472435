// SPDX-License-Identifier: Apache-2.0
// Intel RealSense, by librealsense2.
#include <algorithm>
#include <librealsense2/rs.hpp>
#include <memory>
#include <stdexcept>
#include <string>

#include "dkb/devices/device_module.h"

namespace {

// Coefficients of these kinds are ours or can be turned into ours.
int lens_of(const rs2_intrinsics& in) {
  if (in.model == RS2_DISTORTION_BROWN_CONRADY) return dkb_lens_forward;
  if (in.model == RS2_DISTORTION_INVERSE_BROWN_CONRADY) return dkb_lens_inverse;
  const bool fisheye = in.model == RS2_DISTORTION_FTHETA || in.model == RS2_DISTORTION_KANNALA_BRANDT4;
  const bool straight = std::all_of(in.coeffs, in.coeffs + 5, [](float k) { return k == 0; });
  return straight && !fisheye ? dkb_lens_forward : dkb_lens_other;
}

class Device {
 public:
  static std::vector<std::string> places() {
    const rs2::context context;
    std::vector<std::string> serials;
    for (const rs2::device& device : context.query_devices())
      serials.emplace_back(device.get_info(RS2_CAMERA_INFO_SERIAL_NUMBER));
    return serials;
  }
  Device(const std::string& serial, const DkbDeviceMode& mode) {
    rs2::config config;
    if (!serial.empty()) config.enable_device(serial);
    config.enable_stream(RS2_STREAM_COLOR, mode.width, mode.height, RS2_FORMAT_RGB8, mode.fps);
    config.enable_stream(RS2_STREAM_DEPTH, mode.width, mode.height, RS2_FORMAT_Z16, mode.fps);
    try {
      profile_ = pipeline_.start(config);
    } catch (const rs2::error& e) {
      throw std::runtime_error("librealsense2 cannot start it with " + std::to_string(mode.width) + "x" +
                               std::to_string(mode.height) + " px at " + std::to_string(mode.fps) + " Hz (" + e.what() +
                               "); is it plugged in, and does it give these? `dkb-slam sources` lists the cameras");
    }
    fps_ = mode.fps;
    serial_ = profile_.get_device().get_info(RS2_CAMERA_INFO_SERIAL_NUMBER);
    for (const rs2::sensor& sensor : profile_.get_device().query_sensors())
      if (sensor.is<rs2::depth_sensor>()) metres_per_unit_ = rs2::depth_sensor(sensor).get_depth_scale();
  }
  ~Device() {
    try {
      pipeline_.stop();
    } catch (const rs2::error&) {  // it is gone already
    }
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  std::string place() const { return serial_; }

  void describe(DkbDeviceCamera* camera) const {
    const rs2_intrinsics in = profile_.get_stream(RS2_STREAM_COLOR).as<rs2::video_stream_profile>().get_intrinsics();
    camera->width = in.width, camera->height = in.height, camera->fps = fps_;
    camera->depth_factor = dkb::depth_factor_of(static_cast<double>(metres_per_unit_));
    camera->lens = lens_of(in);
    camera->fx = in.fx, camera->fy = in.fy, camera->cx = in.ppx, camera->cy = in.ppy;
    camera->k1 = in.coeffs[0], camera->k2 = in.coeffs[1], camera->p1 = in.coeffs[2], camera->p2 = in.coeffs[3];
    camera->k3 = in.coeffs[4];
  }

  int next(int timeout_ms, DkbDeviceImage* colour, DkbDeviceImage* depth) {
    try {
      rs2::frameset frames;
      if (!pipeline_.try_wait_for_frames(&frames, static_cast<unsigned>(timeout_ms)))
        return gone() ? dkb_unplugged : dkb_waiting;
      frames_ = align_.process(frames);
    } catch (const rs2::error&) {  // also of a camera that is pulled out meanwhile
      if (gone()) return dkb_unplugged;
      throw;
    }
    give(frames_.get_color_frame(), dkb_rgb8, colour);
    give(frames_.get_depth_frame(), dkb_depth_u16, depth);
    return dkb_images;
  }

 private:
  bool gone() {
    for (const rs2::device& device : context_.query_devices())
      if (device.get_info(RS2_CAMERA_INFO_SERIAL_NUMBER) == serial_) return false;
    return true;
  }

  static void give(const rs2::video_frame& frame, int pixels, DkbDeviceImage* image) {
    if (!frame) return;
    *image = {frame.get_data(),
              frame.get_width(),
              frame.get_height(),
              static_cast<size_t>(frame.get_stride_in_bytes()),
              pixels,
              static_cast<int64_t>(frame.get_timestamp() * 1e6)};
  }

  rs2::context context_;
  rs2::pipeline pipeline_{context_};
  rs2::pipeline_profile profile_;
  rs2::align align_{RS2_STREAM_COLOR};
  rs2::frameset frames_;
  std::string serial_;
  int fps_ = 0;
  float metres_per_unit_ = 0.001F;
};

}  // namespace

extern "C" const DkbDeviceApi* dkb_device_api_3() {
  return dkb::device_api<Device>();
}
