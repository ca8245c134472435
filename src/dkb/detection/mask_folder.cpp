// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/mask_folder.h"

#include <algorithm>
#include <cmath>

#include "dkb/util/disjoint_sets.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

// Pixels first ... last of one row.
struct Run {
  int y = 0, first = 0, last = 0;
};

// Joins those of a region, by their numbers.
std::vector<Run> connected_runs(const GreyImage& mask, DisjointSets* regions) {
  std::vector<Run> runs;
  size_t above = 0;  // first run of the row before
  for (int y = 0; y < mask.height(); ++y) {
    const uint8_t* row = mask.row(y);
    const size_t begin = runs.size();
    for (int x = 0; x < mask.width(); ++x) {
      if (row[x] < 128) continue;
      const int first = x;
      while (x + 1 < mask.width() && row[x + 1] >= 128) ++x;
      const size_t self = runs.size();
      runs.push_back({y, first, x});
      regions->add();
      for (size_t i = above; i < begin; ++i)
        if (runs[i].first <= x + 1 && runs[i].last >= first - 1) regions->join(i, self);
    }
    above = begin;
  }
  return runs;
}

}  // namespace

std::vector<Box> region_boxes(const GreyImage& mask, int min_pixels) {
  struct Region {
    int left, right, top, bottom, pixels;
  };
  DisjointSets joined;
  const std::vector<Run> runs = connected_runs(mask, &joined);
  std::vector<Region> regions(runs.size(), Region{0, 0, 0, 0, 0});  // at the first run's place
  for (size_t i = 0; i < runs.size(); ++i) {
    const Run& run = runs[i];
    Region& region = regions[joined.first_of(i)];
    if (region.pixels == 0) region = {run.first, run.last, run.y, run.y, 0};
    region.left = std::min(region.left, run.first);
    region.right = std::max(region.right, run.last);
    region.bottom = run.y;
    region.pixels += run.last - run.first + 1;
  }
  std::erase_if(regions, [&](const Region& r) { return r.pixels == 0 || r.pixels < min_pixels; });
  std::stable_sort(regions.begin(), regions.end(),
                   [](const Region& a, const Region& b) { return a.pixels > b.pixels; });
  std::vector<Box> boxes;
  for (const Region& r : regions)
    boxes.push_back({static_cast<float>(r.left), static_cast<float>(r.top), static_cast<float>(r.right - r.left + 1),
                     static_cast<float>(r.bottom - r.top + 1)});
  return boxes;
}

std::vector<Detection> mover_boxes(const GreyImage& mask, int min_pixels, int cell) {
  std::vector<Detection> boxes;
  const auto c = static_cast<float>(cell);
  for (const Box& b : region_boxes(mask, min_pixels))
    boxes.push_back({kUnnamedRegion, {c * b.x, c * b.y, c * b.w, c * b.h}, 1});
  return boxes;
}

MaskFolder::MaskFolder(const fs::path& folder, Reader reader, const std::vector<double>& stamps, int width, int height)
    : reader_(std::move(reader)), width_(width), height_(height) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw InputError(folder.string() + ": is no folder; give the folder of STAMP.png masks");
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    double stamp = 0;
    if (it->path().extension() == ".png" && parse_number(it->path().stem().string(), &stamp) && std::isfinite(stamp))
      files_.emplace_back(stamp, it->path());
  }
  if (error) throw InputError(folder.string() + ": cannot be read (" + error.message() + ")");
  if (files_.empty())
    throw InputError(folder.string() + ": holds no mask; masks are named STAMP.png by the colour image's stamp");
  std::sort(files_.begin(), files_.end());
  std::vector<double> sorted = stamps;
  std::sort(sorted.begin(), sorted.end());
  const fs::path* first = sorted.empty() ? &files_.front().second : nullptr;
  for (size_t i = 0; i < sorted.size() && first == nullptr; ++i) first = find(sorted[i]);
  if (first == nullptr)
    throw InputError(folder.string() + ": none of its " + std::to_string(files_.size()) +
                     " masks has the stamp of a colour image (" + files_.front().second.filename().string() +
                     " is the first); name them as in rgb.txt");
  read(*first);
}

const fs::path* MaskFolder::find(double stamp) const {
  const auto* found = find_same_stamp(files_, stamp, [](const auto& file) { return file.first; });
  return found == nullptr ? nullptr : &found->second;
}

GreyImage MaskFolder::read(const fs::path& path) const {
  GreyImage mask = reader_(path);
  if (mask.width() != width_ || mask.height() != height_)
    throw InputError(path.string() + ": the mask is " + std::to_string(mask.width()) + " x " +
                     std::to_string(mask.height()) + " px, the images are " + std::to_string(width_) + " x " +
                     std::to_string(height_));
  for (size_t i = 0; i < mask.size(); ++i) mask.data()[i] = mask.data()[i] > 0 ? 255 : 0;
  return mask;
}

Detections MaskFolder::detect(const DetectorInput& image) {
  Detections found;
  if (const fs::path* path = find(seconds_from_ns(image.stamp_ns))) {
    found.mask = read(*path);
    found.boxes = mover_boxes(found.mask, min_region);
  }
  return found;
}

}  // namespace dkb
