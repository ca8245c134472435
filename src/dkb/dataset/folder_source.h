// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/dataset/folder_layouts.h"
#include "dkb/dataset/reader_source.h"

namespace dkb {

// The option's, else camera.yaml in the folder, else what the layout or the folder's name tells, else the fallback.
CameraChoice choose_folder_camera(const std::filesystem::path& folder, const FolderLayout& layout,
                                  const SourceOptions& options);

// A folder in one of the known layouts as a source.
class FolderSource final : public ReaderSource {
 public:
  FolderSource(const std::filesystem::path& folder, const SourceOptions& options);

  std::optional<size_t> size() const override { return layout_.dataset.pairs.size(); }
  std::string description() const override { return description_; }
  std::vector<std::string> take_warnings() override { return std::exchange(warnings_, {}); }
  std::vector<int64_t> stamps_ns() const override;

  const std::vector<DatasetPair>& pairs() const { return layout_.dataset.pairs; }
  size_t unpaired() const { return static_cast<size_t>(layout_.dataset.unpaired); }  // images without a partner

 private:
  FolderLayout layout_;
  std::string description_;
  std::vector<std::string> warnings_;
};

}  // namespace dkb
