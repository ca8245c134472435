// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "dkb/map/map.h"

namespace dkb::test {

// `keyframes` keyframes a metre apart, each of which makes `points` points two metres before it.
Map world(int keyframes, int points);
// A map without points, whose keyframes hang on nothing: each is a map of its own.
Map unjoined(int keyframes);

// What the page keeps of a stream's messages.
struct StreamReader {
  std::map<int, std::array<float, 3>> keyframes;  // by id: position; culled ones are left out
  std::map<int, int> roots;                       // by keyframe
  std::map<std::pair<uint32_t, uint16_t>, std::array<int16_t, 3>> points;
  std::map<int, size_t> counts;  // messages by kind
  size_t points_sent = 0, loops = 0, hellos = 0;
  size_t facts = 0, path = 0;         // that are known
  int last_fact = -1;                 // its frame
  std::string events, frame;          // the newest messages
  std::map<int, std::string> images;  // by kind

  // Whether these bytes are whole messages.
  bool take(const std::string& bytes);
  bool operator==(const StreamReader&) const = default;
};

}  // namespace dkb::test
