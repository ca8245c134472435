// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/util/stamps.h"

namespace dkb {

// The class of a mask's region: nobody has named what is in it.
inline constexpr const char* kUnnamedRegion = "mover";

// Masks from any segmenter: FOLDER/STAMP.png, where STAMP is the colour image's stamp [s] and above 0 = mover. An image
// gets the mask of the nearest stamp within 2 ms, or none. A mask comes with one box of class "mover" per connected
// region (8-neighbourhood) of at least `min_region` pixels, largest first.
class MaskFolder final : public Detector {
 public:
  using Reader = std::function<GreyImage(const std::filesystem::path&)>;  // grey of an image file; throws InputError

  static constexpr int min_region = 64;  // [px] smaller regions stay in the mask, without a box

  // `stamps`: of the sequence's colour images [s], any order. The mask of the first stamp that has one is read at once
  // and its size compared. None = not known beforehand: the first mask of all is read then. Throws InputError when the
  // folder is missing, when none of its files belongs to any of the stamps, or when that first mask is broken or not
  // width x height [px].
  MaskFolder(const std::filesystem::path& folder, Reader reader, const std::vector<double>& stamps, int width,
             int height);

  // Throws InputError for a mask that cannot be read or has another size.
  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "masks"; }
  bool has(int64_t stamp_ns) const { return find(seconds_from_ns(stamp_ns)) != nullptr; }  // a mask for that image

 private:
  GreyImage read(const std::filesystem::path& path) const;
  const std::filesystem::path* find(double stamp) const;

  Reader reader_;
  int width_, height_;
  std::vector<std::pair<double, std::filesystem::path>> files_;  // by stamp
};

// Bounding boxes of the connected regions (8-neighbourhood) of pixels >= 128 with at least `min_pixels` of them,
// largest first, ties in row-major order of their first pixel.
std::vector<Box> region_boxes(const GreyImage& mask, int min_pixels);
// The same as detections of class "mover", of a mask whose pixels are `cell` px wide.
std::vector<Detection> mover_boxes(const GreyImage& mask, int min_pixels, int cell = 1);

}  // namespace dkb
