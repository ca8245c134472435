// SPDX-License-Identifier: Apache-2.0
// Feature extraction, flow, alignment and matching on the images of a folder, in processor time beside OpenCV's, each
// measured in turn on every image so that both see the same machine.  Usage: features_bench FOLDER [every Nth image]
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/features/matching.h"
#include "dkb/features/optical_flow.h"
#include "dkb/features/orb_extractor.h"
#include "dkb/features/orientation.h"
#include "dkb/features/subpixel.h"
#include "dkb/util/files.h"

namespace {

using namespace dkb;

double processor_ms() {
  return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

class Samples {
 public:
  template <class Work>
  void time(const std::string& name, Work&& work) {
    const double start = processor_ms();
    work();
    samples_[name].push_back(processor_ms() - start);
  }
  double median(const std::string& name) {
    std::vector<double>& v = samples_.at(name);
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
  }

 private:
  std::map<std::string, std::vector<double>> samples_;
};

cv::Mat wrap(const GreyImage& image) {
  return cv::Mat(image.height(), image.width(), CV_8U, const_cast<uint8_t*>(image.data()));
}

// Share of the cells of 40 px that hold a corner.
class Coverage {
 public:
  explicit Coverage(const GreyImage& image)
      : columns_(image.width() / 40 + 1), cells_(static_cast<size_t>(columns_ * (image.height() / 40 + 1))) {}
  void add(float x, float y) {
    cells_[static_cast<size_t>(static_cast<int>(y) / 40 * columns_ + static_cast<int>(x) / 40)] = true;
  }
  double share() const {
    return static_cast<double>(std::count(cells_.begin(), cells_.end(), true)) / static_cast<double>(cells_.size());
  }

 private:
  int columns_;
  std::vector<bool> cells_;
};

// The stages of OrbExtractor one by one.
void time_stages(const GreyImage& image, const OrbOptions& options, Samples& samples) {
  ImagePyramid pyramid({.levels = options.levels, .scale = options.scale});
  pyramid.build(image);
  samples.time("pyramid", [&] { pyramid.build(image); });
  std::vector<std::vector<PixelCorner>> corners(static_cast<size_t>(pyramid.levels()));
  FastCornerFinder finder;
  samples.time("fast", [&] {
    for (int i = 0; i < pyramid.levels(); ++i)
      finder.find(pyramid.level(i), options.fast_threshold_min, kOrbBorder, corners[static_cast<size_t>(i)]);
  });
  CornerSpread spread;
  samples.time("spread", [&] {
    double pixels = 0;
    for (int i = 0; i < pyramid.levels(); ++i) pixels += static_cast<double>(pyramid.level(i).size());
    for (int i = 0; i < pyramid.levels(); ++i) {
      const GreyImage& level = pyramid.level(i);
      const CornerRegion region = orb_region(level);
      if (region.width() <= 0 || region.height() <= 0) continue;
      spread.drop_weak(region, options.fast_threshold, kOrbCellSize, corners[static_cast<size_t>(i)]);
      spread.keep(region, static_cast<int>(options.count * static_cast<double>(level.size()) / pixels),
                  corners[static_cast<size_t>(i)]);
    }
  });
  std::vector<GreyImage> blurred(static_cast<size_t>(pyramid.levels()));
  GaussianBlur blur;
  for (int i = 0; i < pyramid.levels(); ++i) blur.apply(pyramid.level(i), blurred[static_cast<size_t>(i)]);
  samples.time("blur", [&] {
    for (int i = 0; i < pyramid.levels(); ++i) blur.apply(pyramid.level(i), blurred[static_cast<size_t>(i)]);
  });
  std::vector<float> angles, offsets;
  std::vector<Descriptor> descriptors;
  const auto for_each_corner = [&](auto&& visit) {
    for (int i = 0; i < pyramid.levels(); ++i)
      for (const PixelCorner& corner : corners[static_cast<size_t>(i)]) visit(i, corner);
  };
  samples.time("orientation", [&] {
    for_each_corner([&](int i, const PixelCorner& c) {
      const GreyImage& level = pyramid.level(i);
      angles.push_back(orientation_angle(centroid_moments(level.row(c.y) + c.x, level.width())));
    });
  });
  samples.time("sub-pixel", [&] {
    for_each_corner(
        [&](int i, const PixelCorner& c) { offsets.push_back(refine_corner(pyramid.level(i), c.x, c.y).x); });
  });
  const SteeredBrief brief;
  samples.time("descriptors", [&] {
    size_t k = 0;
    for_each_corner([&](int i, const PixelCorner& c) {
      const GreyImage& level = blurred[static_cast<size_t>(i)];
      descriptors.push_back(brief.describe(level.row(c.y) + c.x, level.width(), angles[k++]));
    });
  });
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 2) {
    fmt::print(stderr, "usage: features_bench FOLDER [every Nth image]\n");
    return 2;
  }
  cv::setNumThreads(1);
  const size_t step = argc > 2 ? static_cast<size_t>(std::max(1, std::atoi(argv[2]))) : 5;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  const auto load = [](const std::filesystem::path& path) {
    return decode_picture(read_file(path), path.string()).grey;
  };

  const OrbOptions options;
  OrbExtractor extractor(options);
  const auto orb = cv::ORB::create(options.count);
  ImagePyramid previous_pyramid(flow_pyramid()), next_pyramid(flow_pyramid());
  Samples samples;
  double coverage = 0, orb_coverage = 0, images = 0;
  for (size_t i = 0; i + 1 < paths.size(); i += step) {
    const GreyImage image = load(paths[i]), next = load(paths[i + 1]);
    for (int repetition = 0; repetition < 2; ++repetition) {
      std::vector<cv::KeyPoint> keypoints;
      cv::Mat orb_descriptors;
      samples.time("cv_orb", [&] { orb->detectAndCompute(wrap(image), cv::noArray(), keypoints, orb_descriptors); });
      OrbFeatures features;
      samples.time("extract", [&] { features = extractor.extract(image); });
      time_stages(image, options, samples);
      const OrbFeatures next_features = extractor.extract(next);
      samples.time("match", [&] { match_brute_force(features.descriptors, next_features.descriptors); });

      std::vector<Eigen::Vector2f> points;
      std::vector<cv::Point2f> from, to;
      Coverage ours(image), theirs(image);
      for (const Corner& c : features.corners) {
        points.emplace_back(c.x, c.y);
        from.emplace_back(c.x, c.y);
        ours.add(c.x, c.y);
      }
      for (const cv::KeyPoint& k : keypoints) theirs.add(k.pt.x, k.pt.y);
      coverage += ours.share();
      orb_coverage += theirs.share();
      ++images;
      if (points.empty()) continue;

      previous_pyramid.build(image);
      samples.time("flow pyramid", [&] { next_pyramid.build(next); });
      std::vector<FlowResult> results;
      samples.time("flow", [&] { results = track_flow(previous_pyramid, next_pyramid, points); });
      std::vector<uint8_t> status;
      std::vector<float> errors;
      samples.time("cv flow", [&] {
        cv::calcOpticalFlowPyrLK(wrap(image), wrap(next), from, to, status, errors, {kFlowWindow, kFlowWindow},
                                 flow_pyramid().levels - 1);
      });
    }
  }
  const double unit = samples.median("cv_orb");
  fmt::print("| stage | ms | cv_orb |\n|---|---|---|\n");
  for (const char* name : {"cv_orb", "extract", "pyramid", "fast", "spread", "blur", "orientation", "sub-pixel",
                           "descriptors", "match", "flow pyramid", "flow", "cv flow"})
    fmt::print("| {} | {:.3f} | {:.3f} |\n", name, samples.median(name), samples.median(name) / unit);
  fmt::print("\nflow: {} points; cells of 40 px with a corner: {:.1f} % (cv_orb {:.1f} %)\n", options.count,
             100 * coverage / images, 100 * orb_coverage / images);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "error: {}\n", error.what());
  return 2;
}
