// SPDX-License-Identifier: Apache-2.0
#include "pairing.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace dkb_ros {
namespace {

constexpr int64_t kJump = 1'000'000'000;  // [ns] further back is no late message but another clock
constexpr int64_t kAheadPeriods = 3;      // further ahead, and by more than kJump: a pause or a broken stamp
constexpr int kJumpMessages = 3;          // that must say so; one alone may be broken
constexpr size_t kIntervals = 10;

}  // namespace

// Whether the image has to wait for the next one of its stream: a stamp far ahead would make all that follow late.
bool Pairing::hold(Stream* stream, ImageMessage* image) {
  if (stream->ahead) {
    if (image->stamp_ns > stream->ahead->stamp_ns)
      enter(stream, *std::exchange(stream->ahead, std::nullopt));
    else if (image->stamp_ns < stream->ahead->stamp_ns)
      stream->ahead.reset(), ++late_;
  }
  if (!stream->newest || image->stamp_ns - *stream->newest <= std::max(kJump, kAheadPeriods * stream->period))
    return false;
  if (stream->ahead) ++late_;  // the same one again
  stream->ahead = std::move(*image);
  return true;
}

void Pairing::enter(Stream* stream, ImageMessage image) {
  if (accept(stream, image)) stream->waiting.push_back(std::move(image));
}

// Notes the image's stamp. False: it is left out.
bool Pairing::accept(Stream* stream, const ImageMessage& image) {
  if (stream->newest && image.stamp_ns <= *stream->newest) {
    stream->far_behind = image.stamp_ns < *stream->newest - kJump ? stream->far_behind + 1 : 0;
    ++late_;
    if (stream->far_behind < kJumpMessages) return false;
    forget_images();
    // Images after the last pair go on from it: what lay far ahead was wrong.
    if (last_pair_ && image.stamp_ns <= *last_pair_) clock_jumped_ = true;
  }
  if (stream->newest) {
    stream->intervals.push_back(image.stamp_ns - *stream->newest);
    if (stream->intervals.size() > kIntervals) stream->intervals.pop_front();
    std::vector<int64_t> sorted(stream->intervals.begin(), stream->intervals.end());
    std::sort(sorted.begin(), sorted.end());
    stream->period = sorted[(sorted.size() - 1) / 2];
  }
  stream->newest = image.stamp_ns;
  stream->far_behind = 0;
  return true;
}

void Pairing::restart() {
  forget_images();
  last_pair_.reset();
  clock_jumped_ = false;
}

void Pairing::forget_images() {
  for (Stream* s : {&colour_, &depth_}) {
    unpaired_ += static_cast<int64_t>(s->waiting.size()) + (s->ahead ? 1 : 0);
    *s = {};
  }
}

void Pairing::drop_first(Stream* stream) {
  stream->waiting.pop_front();
  ++unpaired_;
}

std::vector<ImagePair> Pairing::add(Stream* stream, ImageMessage image) {
  if (!hold(stream, &image)) enter(stream, std::move(image));
  std::vector<ImagePair> pairs = match();
  while (stream->waiting.size() > capacity_) drop_first(stream);
  return pairs;
}

std::vector<ImagePair> Pairing::match() {
  std::vector<ImagePair> pairs;
  std::deque<ImageMessage>&colours = colour_.waiting, &depths = depth_.waiting;
  while (!colours.empty() && !depths.empty()) {
    const int64_t stamp = colours.front().stamp_ns;
    if (depths.front().stamp_ns < stamp - tolerance_) {
      drop_first(&depth_);
      continue;
    }
    if (depths.front().stamp_ns > stamp + tolerance_) {
      drop_first(&colour_);
      continue;
    }
    const auto apart = [&](const ImageMessage& depth) { return std::abs(depth.stamp_ns - stamp); };
    const auto best = std::min_element(depths.begin(), depths.end(), [&](const ImageMessage& a, const ImageMessage& b) {
      return apart(a) < apart(b);
    });
    // The next colour image may be the nearer one.
    if (colours.size() > 1 && std::abs(best->stamp_ns - colours[1].stamp_ns) < apart(*best)) {
      drop_first(&colour_);
      continue;
    }
    const int64_t period = std::min(colour_.period, depth_.period);
    const bool final = apart(*best) <= period / 2 || (best->stamp_ns >= stamp && colours.size() > 1) ||
                       (depths.back().stamp_ns >= stamp && best->stamp_ns < stamp);
    if (!final) break;
    while (&depths.front() != &*best) drop_first(&depth_);
    last_pair_ = stamp;
    pairs.push_back({std::move(colours.front()), std::move(depths.front()), clock_jumped_});
    clock_jumped_ = false;
    colours.pop_front();
    depths.pop_front();
  }
  return pairs;
}

}  // namespace dkb_ros
