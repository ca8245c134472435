// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/reader_source.h"

#include <algorithm>
#include <utility>

#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr double kOtherRate = 1.4;  // less is taken for gaps among the first images
constexpr double kNoRate = 1000;    // [1/s] frame_rate_of() says no more: the stamps are of another unit

}  // namespace

void ReaderSource::start(PairStream pairs, const Camera& camera, bool threaded) {
  camera_ = camera;
  reader_ = std::make_unique<RgbdReader>(std::move(pairs), RgbdReaderOptions{.threaded = threaded});
  // A recording may hold every third image of a camera that is known to give 30 a second.
  const double told = frame_rate_of(reader_->first_stamps());
  if (told >= kNoRate) return;  // what the camera tells is kept, which whoever doubts the stamps needs
  if (camera_.fps == 0 || std::max(told, camera_.fps) > kOtherRate * std::min(told, camera_.fps)) camera_.fps = told;
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
