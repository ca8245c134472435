// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/dataset/folder_layouts.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/util/timing.h"
#include "dkb_slam/source.h"

namespace dkb {

// A folder in one of the known layouts as a source.
class FolderSource final : public Source {
 public:
  FolderSource(const std::filesystem::path& folder, const SourceOptions& options);

  const Camera& camera() const override { return camera_; }
  SourceFrame next() override;
  void stop() override { reader_.stop(); }
  std::optional<size_t> size() const override { return layout_.dataset.pairs.size(); }
  std::string description() const override { return description_; }

  const std::vector<DatasetPair>& pairs() const { return layout_.dataset.pairs; }
  // Stage "decoding", one sample per pair. Complete at the end.
  StageTimes times() const { return reader_.times(); }

 private:
  FolderLayout layout_;
  std::string description_;
  Camera camera_;
  RgbdReader reader_;
};

}  // namespace dkb
