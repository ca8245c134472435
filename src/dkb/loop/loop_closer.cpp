// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/loop_closer.h"

namespace dkb {
namespace {

constexpr int kRestKeyframes = 5;  // [keyframes] without a search after a loop was closed: they see the same one

}  // namespace

LoopCloser::LoopCloser(const Optics& optics, const LoopOptions& options, uint64_t seed)
    : optics_(optics), options_(options), seed_(seed) {}

std::optional<MapCorrection> LoopCloser::process(const Map& snapshot, KeyframeId id) {
  if (rests(id)) return std::nullopt;
  const auto finding = find_loop(snapshot, id, optics_, options_, seed_);
  if (!finding) return std::nullopt;
  rests_until_ = id + 1 + kRestKeyframes;
  return correct_loop(snapshot, *finding);
}

}  // namespace dkb
