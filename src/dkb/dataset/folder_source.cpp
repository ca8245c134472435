// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/folder_source.h"

#include "dkb/dataset/camera_file.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

FolderLayout selected_pairs(const std::filesystem::path& folder, const SourceOptions& options) {
  FolderLayout layout = open_folder_layout(folder);
  select_pairs({options.skip_pairs, options.start, options.end, options.max_frames}, &layout.dataset);
  return layout;
}

std::string described(const TumDataset& dataset, const CameraChoice& camera) {
  return std::to_string(dataset.pairs.size()) + " pairs by " + dataset.list + ", camera " + camera.origin;
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
