// SPDX-License-Identifier: Apache-2.0
#include "dkb_slam/opencv.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

TEST(OpenCvAdapter, EveryImageTypeBecomesAViewOfTheSameMemoryAndBack) {
  const std::pair<int, PixelFormat> kinds[] = {{CV_8UC3, PixelFormat::bgr8},
                                               {CV_8UC4, PixelFormat::bgra8},
                                               {CV_8UC1, PixelFormat::grey8},
                                               {CV_16UC1, PixelFormat::depth_u16},
                                               {CV_32FC1, PixelFormat::depth_f32}};
  for (const auto& [type, format] : kinds) {
    const cv::Mat mat(3, 5, type, cv::Scalar::all(7));
    const ImageView view = view_of(mat);
    EXPECT_EQ(view.data, mat.data);
    EXPECT_EQ(view.width, 5);
    EXPECT_EQ(view.height, 3);
    EXPECT_EQ(view.format, format);
    const cv::Mat back = mat_of(view);
    EXPECT_EQ(back.data, mat.data);
    EXPECT_EQ(back.type(), type);
    EXPECT_EQ(back.size(), mat.size());
    EXPECT_EQ(back.step[0], mat.step[0]);
  }
}

TEST(OpenCvAdapter, APartOfAMatrixKeepsItsRows) {
  cv::Mat whole(4, 10, CV_16UC1);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 10; ++x) whole.at<uint16_t>(y, x) = static_cast<uint16_t>(10 * y + x);
  const cv::Mat part = whole(cv::Rect(2, 1, 5, 3));
  const ImageView view = view_of(part);
  EXPECT_EQ(view.stride, 20U);
  EXPECT_EQ(reinterpret_cast<const uint16_t*>(view.row(2))[4], 36);
  EXPECT_EQ(mat_of(view).at<uint16_t>(2, 4), 36);
}

TEST(OpenCvAdapter, PackedViewsNeedNoStride) {
  const uint8_t pixels[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  const cv::Mat mat = mat_of({pixels, 2, 2, 0, PixelFormat::rgb8});
  EXPECT_EQ(mat.type(), CV_8UC3);
  EXPECT_EQ(mat.at<cv::Vec3b>(1, 1), cv::Vec3b(10, 11, 12));  // in the view's order
}

TEST(OpenCvAdapter, OtherTypesAreRefused) {
  EXPECT_THROW(view_of(cv::Mat(2, 2, CV_64FC1)), InputError);
  EXPECT_THROW(view_of(cv::Mat(2, 2, CV_16UC3)), InputError);
}

}  // namespace
}  // namespace dkb
