// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_source.h"

#include <algorithm>
#include <limits>

#include "dkb/dataset/camera_file.h"

namespace dkb {
namespace {

std::string described(const RecordingContents& contents) {
  std::string text = "colour " + contents.colour.name + " (" + contents.colour.encoding + "), depth " +
                     contents.depth.name + " (" + contents.depth.encoding + ")" +
                     (contents.depth_camera ? ", registered by /tf_static" : "") + ", camera " + contents.camera_origin;
  if (contents.motion) text += ", motion of " + contents.motion->name;
  return text;
}

// Where neither the recording nor the selection leaves it open.
std::optional<size_t> pairs_at_most(const MessageStream& stream, const RecordingContents& contents,
                                    const SourceOptions& options) {
  if (options.start > 0 || options.end < std::numeric_limits<double>::infinity()) return std::nullopt;
  std::optional<int64_t> least;
  for (const RecordedTopic& topic : stream.topics()) {
    if (topic.name != contents.colour.name && topic.name != contents.depth.name) continue;
    if (!topic.count) return std::nullopt;
    least = std::min(least.value_or(*topic.count), *topic.count);
  }
  if (!least) return std::nullopt;
  const int64_t left = std::max<int64_t>(0, *least - options.skip_pairs);
  return static_cast<size_t>(std::min(left, options.max_frames.value_or(left)));
}

}  // namespace

RecordedSource::RecordedSource(const std::filesystem::path& path, const SourceOptions& options)
    : RecordedSource(open_messages(path), path.string(), options) {}

RecordedSource::RecordedSource(std::unique_ptr<MessageStream> stream, const std::string& name,
                               const SourceOptions& options) {
  const RecordingContents contents = look_into(*stream, options, name);
  description_ = described(contents);
  size_ = pairs_at_most(*stream, contents, options);
  RecordingContents reading = contents;
  if (!options.depth_limits) reading.camera = without_limits(contents.camera);
  pairs_ = std::make_unique<RecordedPairs>(
      std::move(stream), reading, DatasetSelection{options.skip_pairs, options.start, options.end, options.max_frames},
      name);
  start([pairs = pairs_.get()] { return pairs->next(); }, contents.camera, options.threaded);
}

RecordedSource::~RecordedSource() {
  pairs_->stop();
  end();
}

void RecordedSource::stop() {
  pairs_->stop();
  ReaderSource::stop();
}

}  // namespace dkb
