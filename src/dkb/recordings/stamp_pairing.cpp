// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/stamp_pairing.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dkb/dataset/tum_dataset.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

// The very comparisons of associate(), with their rounding.
bool in_reach(double colour_time, double depth_time) {
  return depth_time >= colour_time - kPairLimit && depth_time <= colour_time + kPairLimit;
}

StampPairing::Kind other(StampPairing::Kind kind) {
  return kind == StampPairing::colour ? StampPairing::depth : StampPairing::colour;
}

}  // namespace

bool StampPairing::add(Kind kind, Stored image) {
  Side& side = sides_[kind];
  const RisingStamps::Answer answer = side.stamps.take(image.stamp_ns);
  if (answer == RisingStamps::Answer::refused) return false;
  side.last = seconds_from_ns(image.stamp_ns);
  side.beyond = std::max(side.beyond, side.last);
  if (answer == RisingStamps::Answer::set_back) {
    forget_from(kind, image.stamp_ns);
    side.beyond = side.last;
  }
  bytes_ += image.bytes.size();
  side.images.push_back({side.last, State::waiting, std::move(image), {}});
  resolve();
  bound();
  return true;
}

void StampPairing::forget_from(Kind kind, int64_t stamp_ns) {
  std::deque<Waiting>& images = sides_[kind].images;
  for (; !images.empty() && images.back().image.stamp_ns >= stamp_ns; images.pop_back()) {
    const Waiting& last = images.back();
    if (last.state == State::waiting) ++unpaired_;
    if (last.state == State::paired && kind == colour) unpaired_ += 2;
    bytes_ -= last.image.bytes.size() + last.partner.bytes.size();
  }
}

int64_t StampPairing::behind() const {
  int64_t images = 0;
  for (const Side& side : sides_)
    if (side.stamps.behind()) images += side.stamps.refused();
  return images;
}

bool StampPairing::far_ahead(const Waiting& colour_image) const {
  return !closed_ && sides_[colour].images.size() == 1 &&
         (!taken_ || colour_image.time - *taken_ > RisingStamps::kFarAhead);
}

void StampPairing::close() {
  closed_ = true;
  resolve();
}

std::optional<StampPairing::Pair> StampPairing::take() {
  std::deque<Waiting>& images = sides_[colour].images;
  while (!images.empty() && images.front().state != State::waiting) {
    if (images.front().state == State::paired && far_ahead(images.front())) return std::nullopt;
    Waiting front = std::move(images.front());
    images.pop_front();
    if (front.state == State::left_over) continue;
    bytes_ -= front.image.bytes.size() + front.partner.bytes.size();
    taken_ = front.time;
    sides_[colour].stamps.hand_on(front.image.stamp_ns), sides_[depth].stamps.hand_on(front.partner.stamp_ns);
    return Pair{std::move(front.image), std::move(front.partner)};
  }
  return std::nullopt;
}

std::optional<size_t> StampPairing::nearest(Kind kind, const Waiting& image) const {
  std::optional<size_t> found;
  double best = 0;
  const std::deque<Waiting>& others = sides_[other(kind)].images;
  for (size_t i = 0; i < others.size(); ++i) {
    if (others[i].state != State::waiting) continue;
    const bool reachable = kind == colour ? in_reach(image.time, others[i].time) : in_reach(others[i].time, image.time);
    const double difference = std::abs(image.time - others[i].time);
    if (!reachable || (found && difference >= best)) continue;
    found = i, best = difference;
  }
  return found;
}

// Stamps rise: what comes lies at or beyond the newest one of its side.
bool StampPairing::could_still_be_nearer(Kind kind, const Waiting& image, double difference) const {
  const double beyond = sides_[other(kind)].beyond;
  return !closed_ && difference != 0 && (beyond < image.time || beyond - image.time < difference);
}

bool StampPairing::could_still_pair(Kind kind, const Waiting& image) const {
  const double beyond = sides_[other(kind)].beyond;
  if (closed_ || beyond <= image.time) return !closed_;
  return kind == colour ? in_reach(image.time, beyond) : in_reach(beyond, image.time);
}

void StampPairing::join(size_t colour_index, size_t depth_index) {
  Waiting &c = sides_[colour].images[colour_index], &d = sides_[depth].images[depth_index];
  c.state = d.state = State::paired;
  c.partner = std::move(d.image);
}

void StampPairing::resolve() {
  std::deque<Waiting>&colours = sides_[colour].images, &depths = sides_[depth].images;
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t i = 0; i < colours.size(); ++i) {
      if (colours[i].state != State::waiting) continue;
      const std::optional<size_t> j = nearest(colour, colours[i]);
      if (!j || nearest(depth, depths[*j]) != i) continue;
      const double difference = std::abs(colours[i].time - depths[*j].time);
      if (could_still_be_nearer(colour, colours[i], difference) || could_still_be_nearer(depth, depths[*j], difference))
        continue;
      join(i, *j);
      changed = true;
    }
  }
  for (const Kind kind : {colour, depth})
    for (Waiting& image : sides_[kind].images)
      if (image.state == State::waiting && !could_still_pair(kind, image) && !nearest(kind, image)) {
        image.state = State::left_over;
        bytes_ -= std::exchange(image.image.bytes, {}).size();
        ++unpaired_;
      }
  // The bytes of those that are paired have moved to their partners.
  while (!depths.empty() && depths.front().state != State::waiting) depths.pop_front();
}

void StampPairing::bound() {
  for (const Kind kind : {colour, depth}) {
    const std::deque<Waiting>& images = sides_[kind].images;
    const auto oldest =
        std::find_if(images.begin(), images.end(), [](const Waiting& image) { return image.state == State::waiting; });
    const auto newer = static_cast<size_t>(images.end() - oldest);
    if (newer > kPatienceImages && sides_[kind].last - oldest->time > kPatience) {
      Side& silent = sides_[other(kind)];
      silent.beyond = std::max(silent.beyond, oldest->time + kPatience / 4);
      resolve();
    }
  }
  if (sides_[colour].images.size() < kMaxWaiting && sides_[depth].images.size() < kMaxWaiting && bytes_ < kMaxBytes)
    return;
  closed_ = true;
  resolve();
  closed_ = false;
}

}  // namespace dkb
