// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/matching/optics.h"
#include "dkb/util/random.h"

namespace dkb {

// How a view of the TestScene is spoilt.
struct ViewOptions {
  double pixel_noise = 0;  // [px] standard deviation at the finest level
  double depth_noise = 0;  // [m]
  double depth_share = 1;  // part of the features with depth
  int flipped_bits = 0;    // of every descriptor, at most
  int clutter = 0;         // features that show no point: random places, depths and descriptors
  double misplaced = 0;    // share of the features that are moved by 20 to 60 px: wrong matches
  int hidden = -1;         // a point of the scene that is not seen
  uint64_t seed = 1;       // of all of it
};

struct View {
  std::shared_ptr<const RgbdFeatures> features;
  std::vector<int> shows;  // per feature: the scene's point, -1 = clutter
};

// Points before the camera, each with a random descriptor of its own, seen without any image: what extraction would
// find is made directly. For tests of tracking and mapping.
class TestScene {
 public:
  static constexpr double kScaleFactor = 1.2;
  static constexpr int kLevels = 8;

  explicit TestScene(int count, uint64_t seed = 1, double nearest = 1.5, double farthest = 3.5) {
    Random random(seed);
    for (int i = 0; i < count; ++i) {
      points.push_back({random.uniform(-3, 3), random.uniform(-2, 2), random.uniform(nearest, farthest)});
      descriptors.push_back(random_descriptor(random));
      fine_at_.push_back(random.uniform(1.5, 6.0));
    }
  }

  static Descriptor random_descriptor(Random& random) {
    return {random.next(), random.next(), random.next(), random.next()};
  }
  static Rigid3 camera_at(const Eigen::Vector3d& centre, const Eigen::Vector3d& rotation = Eigen::Vector3d::Zero()) {
    return Rigid3(rotation_from_vector(rotation), centre).inverse();
  }

  Optics optics(const SensorNoise& noise = {}) const { return {camera, noise, kScaleFactor, kLevels}; }
  // The level on which a point is found from a distance [m].
  int octave(int point, double distance) const {
    const double level = std::log(fine_at_[static_cast<size_t>(point)] / distance) / std::log(kScaleFactor);
    return std::clamp(static_cast<int>(std::lround(level)), 0, kLevels - 1);
  }

  View look(const Rigid3& cam_from_world, const ViewOptions& options = {}) const {
    Random random(options.seed);
    View view;
    auto features = std::make_shared<RgbdFeatures>();
    const auto add = [&](int shows, const Eigen::Vector2d& pixel, double depth, int octave, Descriptor descriptor) {
      Keypoint k;
      k.pixel = k.image_pixel = pixel.cast<float>();
      k.depth = static_cast<float>(depth);
      k.octave = static_cast<uint8_t>(octave);
      features->keypoints.push_back(k);
      for (int b = 0; b < options.flipped_bits; ++b) {
        const uint32_t bit = random.below(256);
        descriptor[bit / 64] ^= uint64_t{1} << (bit % 64);
      }
      features->descriptors.push_back(descriptor);
      view.shows.push_back(shows);
    };
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d in_cam = cam_from_world * points[i];
      // Drawn for every point, in view or not, so that the same seed treats a point alike in every view.
      const Eigen::Vector2d noise{random.normal(), random.normal()};
      const bool misplaced = random.uniform() < options.misplaced, deep = random.uniform() < options.depth_share;
      const Eigen::Vector2d off{random.uniform(20, 60), -random.uniform(20, 60)};
      const double depth_noise = options.depth_noise * random.normal();
      if (in_cam.z() < 0.3 || static_cast<int>(i) == options.hidden) continue;
      const int level = octave(static_cast<int>(i), in_cam.norm());
      Eigen::Vector2d pixel = camera.project(in_cam) + options.pixel_noise * std::pow(kScaleFactor, level) * noise;
      if (misplaced) pixel += off;
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera.width || pixel.y() >= camera.height) continue;
      add(static_cast<int>(i), pixel, deep ? in_cam.z() + depth_noise : 0, level, descriptors[i]);
    }
    for (int i = 0; i < options.clutter; ++i) {
      const Eigen::Vector2d pixel{random.uniform(0, camera.width), random.uniform(0, camera.height)};
      const double depth = random.uniform(1, 4);
      const int level = static_cast<int>(random.below(kLevels));
      add(-1, pixel, depth, level, random_descriptor(random));
    }
    features->grid = KeypointGrid(features->keypoints, camera.width, camera.height);
    view.features = std::move(features);
    return view;
  }

  CameraModel camera;
  std::vector<Eigen::Vector3d> points;  // [m] in the world
  std::vector<Descriptor> descriptors;

 private:
  std::vector<double> fine_at_;  // [m] distance from which the point is found on the finest level
};

// Degrees between two rotations, metres between two cameras.
inline double rotation_between(const Rigid3& a, const Rigid3& b) {
  return vector_from_rotation((a * b.inverse()).rotation).norm() * 180 / M_PI;
}
inline double distance_between(const Rigid3& a, const Rigid3& b) {
  return (centre_in_world(a) - centre_in_world(b)).norm();
}

}  // namespace dkb
