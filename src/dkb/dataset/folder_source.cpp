// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/folder_source.h"

#include <fmt/format.h>

#include "dkb/dataset/camera_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

FolderLayout selected_pairs(const std::filesystem::path& folder, const SourceOptions& options) {
  FolderLayout layout = open_folder_layout(folder);
  select_pairs({options.skip_pairs, options.start, options.end, options.max_frames}, &layout.dataset);
  return layout;
}

std::string described(const TumDataset& dataset, const CameraChoice& camera) {
  const std::string unpaired =
      dataset.unpaired == 0 ? "" : ", " + std::to_string(dataset.unpaired) + " images without a partner of their time";
  return std::to_string(dataset.pairs.size()) + " pairs by " + dataset.list + unpaired + ", camera " + camera.origin;
}

// Why stamps may be no seconds; empty when nothing speaks for it.
std::string doubt_of_stamps(const TumDataset& dataset) {
  constexpr double kSlow = 2;     // [s] between frames; nothing can be tracked from one to the next
  constexpr double kFast = 2e-3;  // [s] no camera of depth gives 500 frames a second
  std::vector<double> intervals;
  for (size_t i = 1; i < dataset.pairs.size(); ++i)
    intervals.push_back(dataset.pairs[i].timestamp - dataset.pairs[i - 1].timestamp);
  if (intervals.empty()) return "";
  const double median = upper_median(intervals);
  if (median >= kFast && median <= kSlow) return "";
  return fmt::format("{}: the stamps of {} are {:.2g} s apart in the median; they must be in seconds",
                     dataset.folder.string(), dataset.list, median);
}

}  // namespace

CameraChoice choose_folder_camera(const std::filesystem::path& folder, const FolderLayout& layout,
                                  const SourceOptions& options) {
  const bool told = !options.camera.empty() || std::filesystem::exists(folder / "camera.yaml");
  if (!told && layout.camera) return *layout.camera;
  try {
    return choose_camera(options.camera, folder);
  } catch (const InputError&) {
    if (told || !options.fallback_camera) throw;
    return {*options.fallback_camera, "of the map"};
  }
}

FolderSource::FolderSource(const std::filesystem::path& folder, const SourceOptions& options)
    : layout_(selected_pairs(folder, options)) {
  const CameraChoice choice = choose_folder_camera(folder, layout_, options);
  choice.camera.check();
  description_ = described(layout_.dataset, choice);
  for (const std::string& doubt : {choice.doubt, doubt_of_stamps(layout_.dataset)})
    if (!doubt.empty()) warnings_.push_back(doubt);
  const Camera reading = options.depth_limits ? choice.camera : without_limits(choice.camera);
  start(pairs_in_files(layout_.dataset.pairs, reading, layout_.fit_colour), choice.camera, options.threaded);
}

std::vector<int64_t> FolderSource::stamps_ns() const {
  std::vector<int64_t> stamps;
  for (const DatasetPair& pair : layout_.dataset.pairs) stamps.push_back(pair.stamp_ns);
  return stamps;
}

std::unique_ptr<Source> open_folder(const std::filesystem::path& folder, const SourceOptions& options) {
  return std::make_unique<FolderSource>(folder, options);
}

}  // namespace dkb
