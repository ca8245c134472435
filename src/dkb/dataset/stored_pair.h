// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/dataset/tum_dataset.h"
#include "dkb/geometry/camera.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

// One colour and one depth image as they are stored. The functions may be called on any thread, by several at
// once.
struct StoredPair {
  double timestamp = 0;                      // [s] colour
  int64_t stamp_ns = 0, depth_stamp_ns = 0;  // exactly
  std::string stamp;                         // colour, as the recording writes it
  std::optional<MotionPrior> prior;          // of the motion since the pair before
  // What is wrong with the type or the size of images that are sound in themselves, by their headers: the recording is
  // of another kind than the camera. Empty when nothing is. Throws InputError when an image is broken.
  std::function<std::string()> mismatch;
  // Throws InputError when one of the images is broken or does not fit.
  std::function<std::shared_ptr<RgbdImage>()> decode;
  // Of recordings: the colour image as it is stored, while the pair lives; empty where it is pixels. Throws InputError
  // when it is broken.
  std::function<std::string_view()> colour_file = {};
};

// Answers pair by pair, colour stamps rising; nothing at the end. Called by one thread at a time.
using PairStream = std::function<std::optional<StoredPair>()>;

// The pairs of files that the lists of a folder name. `fit_colour`: colour images of another size are resampled to the
// camera's, to which depth belongs.
PairStream pairs_in_files(std::vector<DatasetPair> pairs, const CameraModel& camera, bool fit_colour = false);

// What is wrong with a pair, by what `of_image` says of each of its two: a wrong depth image counts for more than a
// broken colour image. Throws InputError when an image is broken and the other one not wrong.
std::string pair_mismatch(const std::function<std::string(bool is_depth)>& of_image);

// Empty when an image has the camera's size; else what is wrong, for people.
std::string size_mismatch(const std::string& name, int width, int height, const CameraModel& camera);
// The same of an image amid others that fit.
std::string size_change(const std::string& name, int width, int height, const CameraModel& camera);

}  // namespace dkb
