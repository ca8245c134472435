// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/chunked_stream.h"

#include <algorithm>

#include "dkb/util/errors.h"

namespace dkb {

std::optional<RecordedMessage> ChunkedStream::next() {
  do {
    if (auto message = next_in_chunk()) return message;
  } while (next_chunk());
  return std::nullopt;
}

std::optional<size_t> ChunkedStream::wanted(uint32_t channel) const {
  const auto found = topic_of_.find(channel);
  if (found == topic_of_.end() || !found->second || !topics_.wanted(*found->second)) return std::nullopt;
  return found->second;
}

// A chunk that the index does not know, or of a channel that is not known, may hold anything.
bool ChunkedStream::chunk_wanted(uint64_t at) const {
  const auto chunk = chunks_.find(at);
  if (chunk == chunks_.end() || chunk->second.empty()) return true;
  return std::any_of(chunk->second.begin(), chunk->second.end(),
                     [&](uint32_t channel) { return !topic_of_.contains(channel) || wanted(channel); });
}

std::string ChunkedStream::load(std::string_view compression, uint64_t at, uint64_t packed, uint64_t size) {
  Compression kind = Compression::none;
  try {
    kind = compression_named(compression);
  } catch (const InputError& e) {
    throw InputError(file_->name() + ": " + e.what());
  }
  const ChunkState loaded = load_chunk(*file_, kind, at, packed, size, &chunk_);
  cut_in_chunk_ = loaded.state == ChunkState::cut;
  if (cut_in_chunk_) tell_cut(chunk_at_);
  const bool broken = loaded.state == ChunkState::broken;
  rest_ = broken ? std::string_view() : chunk_.view();
  return broken ? loaded.why : "";
}

bool ChunkedStream::skip_to_chunk_after(uint64_t at) {
  const auto later = chunks_.upper_bound(at);
  if (later == chunks_.end() || later->first >= end_) return false;
  at_ = later->first;
  return true;
}

void ChunkedStream::tell_cut(uint64_t at) {
  if (!told_cut_) warn("is cut off in the record at byte " + std::to_string(at) + "; it is read up to there");
  told_cut_ = true;
}

}  // namespace dkb
