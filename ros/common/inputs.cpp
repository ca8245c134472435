// SPDX-License-Identifier: Apache-2.0
#include "inputs.h"

#include <bit>
#include <map>

namespace dkb_ros {

dkb::ImageView view_of(const ImageMessage& image, bool depth) {
  using dkb::PixelFormat;
  static const std::map<std::string, PixelFormat> colours = {
      {"rgb8", PixelFormat::rgb8},   {"bgr8", PixelFormat::bgr8},   {"8UC3", PixelFormat::bgr8},
      {"rgba8", PixelFormat::rgba8}, {"bgra8", PixelFormat::bgra8}, {"8UC4", PixelFormat::bgra8},
      {"mono8", PixelFormat::grey8}, {"8UC1", PixelFormat::grey8}};
  static const std::map<std::string, PixelFormat> depths = {
      {"16UC1", PixelFormat::depth_u16}, {"mono16", PixelFormat::depth_u16}, {"32FC1", PixelFormat::depth_f32}};
  const std::string topic = depth ? "depth/image" : "rgb/image";
  const auto& known = depth ? depths : colours;
  const auto format = known.find(image.encoding);
  if (format == known.end())
    throw dkb::InputError(
        topic + ": encoding \"" + image.encoding + "\" is not read; publish " +
        (depth ? "16UC1 or 32FC1" : "rgb8, bgr8, rgba8, bgra8 or mono8 (image_proc converts others)"));
  dkb::ImageView view{image.data, image.width, image.height, image.step, format->second};
  if (depth && image.is_bigendian != (std::endian::native == std::endian::big))
    throw dkb::InputError(topic + ": its byte order is not this machine's; publish it in this machine's");
  if (image.width <= 0 || image.height <= 0 || view.stride < view.row_bytes() ||
      image.size < view.stride * static_cast<size_t>(image.height - 1) + view.row_bytes())
    throw dkb::InputError(topic + ": " + std::to_string(image.size) +
                          " bytes are fewer than its width, height and step say");
  return view;
}

dkb::Camera camera_of(const CameraInfoMessage& info, bool rectified) {
  dkb::Camera camera;
  camera.width = info.width;
  camera.height = info.height;
  if (rectified) {
    camera.fx = info.p[0], camera.fy = info.p[5], camera.cx = info.p[2], camera.cy = info.p[6];
  } else {
    camera.fx = info.k[0], camera.fy = info.k[4], camera.cx = info.k[2], camera.cy = info.k[5];
  }
  if (!(camera.fx > 0 && camera.fy > 0))
    throw dkb::InputError("rgb/camera_info: it holds no calibration (focal length 0); calibrate, or set `camera`");
  try {
    if (!rectified) camera.set_distortion(info.distortion_model, {info.d.begin(), info.d.end()});
  } catch (const dkb::InputError& e) {
    throw dkb::InputError(std::string("rgb/camera_info: ") + e.what() +
                          "; publish rectified images and set `rectified`, or set `camera`");
  }
  return camera;
}

}  // namespace dkb_ros
