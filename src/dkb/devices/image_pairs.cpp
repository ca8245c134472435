// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/image_pairs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "dkb/dataset/tum_dataset.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr size_t kMostWaiting = 8;  // images of a stream whose other stream is silent

// [ns] between the images of a pair
int64_t max_difference() {
  return std::llround(1e9 * (kPairLimit));
}

}  // namespace

KeptImage::KeptImage(const DeviceImage& image) : view(image.view), stamp_ns(image.stamp_ns) {
  const size_t row = view.row_bytes();
  bytes.resize(row * static_cast<size_t>(view.height));
  for (int y = 0; y < view.height; ++y)
    std::memcpy(bytes.data() + static_cast<size_t>(y) * row, image.view.row(y), row);
  view.data = bytes.data();
  view.stride = row;
}

void ImagePairs::add(const DeviceImage& image, bool is_depth) {
  Stream& stream = is_depth ? depth_ : colour_;
  const std::optional<int64_t> before = stream.stamps.last();
  const auto answer = is_stamp(image.stamp_ns) ? stream.stamps.take(image.stamp_ns) : RisingStamps::Answer::refused;
  if (answer == RisingStamps::Answer::refused) {
    ++late_;
    return;
  }
  if (answer == RisingStamps::Answer::set_back) {
    for (std::deque<KeptImage>& waiting = stream.waiting; !waiting.empty() && waiting.back().stamp_ns >= image.stamp_ns;
         waiting.pop_back())
      ++unpaired_;
  } else if (before) {
    stream.interval = image.stamp_ns - *before;
  }
  if (stream.waiting.size() >= kMostWaiting) drop_front(stream);
  stream.waiting.emplace_back(image);
}

std::optional<ImagePair> ImagePairs::take() {
  const int64_t most_apart = max_difference();
  std::deque<KeptImage>&colours = colour_.waiting, &depths = depth_.waiting;
  const auto apart = [](const KeptImage& a, const KeptImage& b) { return std::abs(a.stamp_ns - b.stamp_ns); };
  while (!colours.empty() && !depths.empty()) {
    const KeptImage& colour = colours.front();
    while (depths.size() > 1 && apart(colour, depths[1]) <= apart(colour, depths[0])) drop_front(depth_);
    const int64_t difference = apart(colour, depths.front());
    // What comes later is one interval further on at least, so half of it is near enough not to wait.
    const bool depth_settled = closed_ || depths.size() > 1 || depths.front().stamp_ns >= colour.stamp_ns ||
                               (depth_.interval > 0 && 2 * difference <= depth_.interval);
    if (difference > most_apart) {
      if (depths.front().stamp_ns > colour.stamp_ns)
        drop_front(colour_);
      else
        drop_front(depth_);
      continue;
    }
    if (!depth_settled) return std::nullopt;
    // The depth image may suit the next colour image better.
    const bool colour_settled = closed_ || colours.size() > 1 || colour.stamp_ns >= depths.front().stamp_ns ||
                                (colour_.interval > 0 && 2 * difference <= colour_.interval);
    if (colours.size() > 1 && apart(colours[1], depths.front()) < difference) {
      drop_front(colour_);
      continue;
    }
    if (!colour_settled) return std::nullopt;
    if (!closed_ && taken_ && colours.size() == 1 &&
        seconds_from_ns(colour.stamp_ns - *taken_) > RisingStamps::kFarAhead)
      return std::nullopt;
    ImagePair pair{std::move(colours.front()), std::move(depths.front())};
    taken_ = pair.colour.stamp_ns;
    colour_.stamps.hand_on(pair.colour.stamp_ns), depth_.stamps.hand_on(pair.depth.stamp_ns);
    colours.pop_front(), depths.pop_front();
    return pair;
  }
  return std::nullopt;
}

void ImagePairs::restart() {
  for (Stream* stream : {&colour_, &depth_}) {
    unpaired_ += static_cast<int64_t>(stream->waiting.size());
    *stream = {};
  }
  taken_.reset();
}

}  // namespace dkb
