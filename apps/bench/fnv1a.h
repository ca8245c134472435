// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace dkb::bench {

inline constexpr uint64_t kFnv1aStart = 0xCBF29CE484222325ULL;

// The checksum FNV-1a of `bytes` behind those that gave `hash`.
inline uint64_t fnv1a(std::string_view bytes, uint64_t hash = kFnv1aStart) {
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return hash;
}

}  // namespace dkb::bench
