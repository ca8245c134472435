// SPDX-License-Identifier: Apache-2.0
/// \file
/// cv::Mat in and out, without copies. Header only: the library itself does not need OpenCV.
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "dkb_slam/errors.h"
#include "dkb_slam/image.h"

namespace dkb {

/// A view of the matrix, which must outlive it: CV_8UC3 (bgr8) and CV_8UC4 (bgra8) in OpenCV's order, CV_8UC1 (grey8),
/// CV_16UC1 (depth_u16), CV_32FC1 (depth_f32). Throws InputError for other types.
inline ImageView view_of(const cv::Mat& mat) {
  ImageView view{mat.data, mat.cols, mat.rows, mat.step[0], PixelFormat::bgr8};
  switch (mat.type()) {
    case CV_8UC3:
      return view;
    case CV_8UC4:
      view.format = PixelFormat::bgra8;
      return view;
    case CV_8UC1:
      view.format = PixelFormat::grey8;
      return view;
    case CV_16UC1:
      view.format = PixelFormat::depth_u16;
      return view;
    case CV_32FC1:
      view.format = PixelFormat::depth_f32;
      return view;
    default:
      throw InputError("cv::Mat: type " + std::to_string(mat.type()) +
                       " is no image format; give CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1 or CV_32FC1");
  }
}

/// A matrix over the view's pixels, which must outlive it. The channels stay in the view's order (rgb8 is not swapped).
inline cv::Mat mat_of(const ImageView& view) {
  static constexpr int types[] = {CV_8UC3, CV_8UC3, CV_8UC4, CV_8UC4, CV_8UC1, CV_16UC1, CV_32FC1};
  return cv::Mat(view.height, view.width, types[static_cast<int>(view.format)], const_cast<void*>(view.data),
                 view.stride == 0 ? view.row_bytes() : view.stride);
}

}  // namespace dkb
