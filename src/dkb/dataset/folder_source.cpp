// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/folder_source.h"

#include "dkb/dataset/camera_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

FolderLayout selected_pairs(const std::filesystem::path& folder, const SourceOptions& options) {
  FolderLayout layout = open_folder_layout(folder);
  select_pairs({options.skip_pairs, options.start, options.end, options.max_frames}, &layout.dataset);
  return layout;
}

CameraChoice camera_of(const std::filesystem::path& folder, const FolderLayout& layout, const SourceOptions& options) {
  const bool told = !options.camera.empty() || std::filesystem::exists(folder / "camera.yaml");
  if (!told && layout.camera) return *layout.camera;
  try {
    return choose_camera(options.camera, folder);
  } catch (const InputError&) {
    if (told || !options.fallback_camera) throw;
    return {*options.fallback_camera, "of the map"};
  }
}

double rate_of(const std::vector<DatasetPair>& pairs) {
  std::vector<int64_t> stamps;
  for (size_t i = 0; i < pairs.size() && i < 5; ++i) stamps.push_back(pairs[i].stamp_ns);
  return frame_rate_of(stamps);
}

std::string described(const TumDataset& dataset, const CameraChoice& camera) {
  return std::to_string(dataset.pairs.size()) + " pairs by " + dataset.list + ", camera " + camera.origin;
}

}  // namespace

FolderSource::FolderSource(const std::filesystem::path& folder, const SourceOptions& options)
    : layout_(selected_pairs(folder, options)),
      reader_(layout_.dataset.pairs,
              [&] {
                const CameraChoice choice = camera_of(folder, layout_, options);
                description_ = described(layout_.dataset, choice);
                camera_ = choice.camera;
                if (camera_.fps == 0) camera_.fps = rate_of(layout_.dataset.pairs);
                return camera_;
              }(),
              {.threaded = options.threaded, .fit_colour = layout_.fit_colour}) {}

SourceFrame FolderSource::next() {
  SourceFrame next;
  auto read = reader_.next();
  if (!read) return next;
  next.index = read->index;
  next.stamp = std::move(read->stamp);
  next.note = std::move(read->skipped);
  next.state = read->image == nullptr ? SourceState::skipped : SourceState::frame;
  const DatasetPair& pair = layout_.dataset.pairs[read->index];
  if (read->image != nullptr) next.frame = Frame(std::move(read->image), pair.stamp_ns, pair.depth_stamp_ns);
  return next;
}

std::unique_ptr<Source> open_folder(const std::filesystem::path& folder, const SourceOptions& options) {
  return std::make_unique<FolderSource>(folder, options);
}

}  // namespace dkb
