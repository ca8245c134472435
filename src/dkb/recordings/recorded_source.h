// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/dataset/reader_source.h"
#include "dkb/recordings/recorded_pairs.h"

namespace dkb {

// A recording of ROS messages as a source: .bag, .mcap, .db3 or the folder of a rosbag2.
class RecordedSource final : public ReaderSource {
 public:
  RecordedSource(const std::filesystem::path& path, const SourceOptions& options);
  // `name` opens the messages.
  RecordedSource(std::unique_ptr<MessageStream> stream, const std::string& name, const SourceOptions& options);
  ~RecordedSource() override;

  void stop() override;
  std::vector<std::string> take_warnings() override { return pairs_->take_warnings(); }
  SourceCounts counts() const override { return pairs_->counts(); }
  std::optional<size_t> size() const override { return size_; }
  std::string description() const override { return description_; }

 private:
  std::string description_;
  std::optional<size_t> size_;
  std::unique_ptr<RecordedPairs> pairs_;
};

}  // namespace dkb
