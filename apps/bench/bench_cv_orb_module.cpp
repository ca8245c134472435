// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_cv_orb_module.h"

#include <chrono>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <vector>

extern "C" __attribute__((visibility("default"))) double dkb_cv_orb_1(const unsigned char* grey, int width,
                                                                      int height) {
  try {
    cv::setNumThreads(1);
    static const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000);
    const cv::Mat image(height, width, CV_8U, const_cast<unsigned char*>(grey));
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    const auto start = std::chrono::steady_clock::now();
    orb->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  } catch (...) {
    return -1;
  }
}
