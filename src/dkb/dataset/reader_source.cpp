// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/reader_source.h"

#include <utility>

#include "dkb/util/stamps.h"

namespace dkb {

void ReaderSource::start(PairStream pairs, const Camera& camera, bool threaded) {
  camera_ = camera;
  reader_ = std::make_unique<RgbdReader>(std::move(pairs), RgbdReaderOptions{.threaded = threaded});
  if (camera_.fps == 0) camera_.fps = frame_rate_of(reader_->first_stamps());
}

SourceFrame ReaderSource::next() {
  SourceFrame next;
  auto read = reader_->next();
  if (!read) return next;
  next.index = read->index;
  next.stamp = std::move(read->stamp);
  next.note = std::move(read->skipped);
  next.state = read->image == nullptr ? SourceState::skipped : SourceState::frame;
  if (read->image != nullptr) next.frame = Frame(std::move(read->image), read->stamp_ns, read->depth_stamp_ns);
  next.frame.set_prior(read->prior);
  if (next.state == SourceState::skipped) {
    skipped_.skip(next.frame);
    next.frame = {};
  } else {
    next.frame = std::exchange(skipped_, {}).with_motion(std::move(next.frame));
  }
  return next;
}

}  // namespace dkb
