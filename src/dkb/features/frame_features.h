// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "dkb/features/rgbd_features.h"

namespace dkb {

// What is known of the surface that a feature lies on.
enum class FeatureMotion : uint8_t {
  still,     // nothing speaks against it
  on_mover,  // a mover is seen there: only well-established map points may be found
};

// Features as matching takes them. Without `motion` all of them stand still.
struct MatchableFeatures {
  const RgbdFeatures& features;
  std::span<const FeatureMotion> motion;  // per feature

  MatchableFeatures(const RgbdFeatures& f, std::span<const FeatureMotion> m = {}) : features(f), motion(m) {}
  bool on_mover(size_t feature) const { return !motion.empty() && motion[feature] == FeatureMotion::on_mover; }
};

// The features of a frame that tracking may use. Where they lie and how deep depends on the camera's velocity [m/s,
// rad/s]: rows are exposed one after the other, and the depth image is of another time.
class FrameFeatures {
 public:
  virtual ~FrameFeatures() = default;
  virtual std::shared_ptr<const RgbdFeatures> at(const Vector6d& velocity) const = 0;

  std::vector<FeatureMotion> motion;  // per feature; empty = all stand still
};

// Those that the extractor found in an image. What it is made of must outlive it.
class ExtractedFeatures final : public FrameFeatures {
 public:
  ExtractedFeatures(const OrbFeatures& orb, const RgbdImage& image, const Camera& camera,
                    const UndistortionTable& undistort, const SensorNoise& noise, const DepthOptions& options)
      : orb_(orb),
        image_(image),
        camera_(camera),
        noise_(noise),
        options_(options),
        as_seen_(keypoints_as_seen(orb, image, undistort, camera, noise)) {}
  std::shared_ptr<const RgbdFeatures> at(const Vector6d& velocity) const override {
    return std::make_shared<const RgbdFeatures>(
        make_rgbd_features(orb_.descriptors, as_seen_, image_, camera_, noise_, velocity, options_));
  }

 private:
  const OrbFeatures& orb_;
  const RgbdImage& image_;
  const Camera& camera_;
  const SensorNoise& noise_;
  const DepthOptions& options_;
  const std::vector<Keypoint> as_seen_;
};

}  // namespace dkb
