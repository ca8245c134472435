// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

// The numbers of the bag format 2.0 (wiki.ros.org/Bags/Format/2.0) that its reader and its writer share.
namespace dkb::bag {

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

enum Op : uint8_t { kMessage = 2, kBagHeader = 3, kIndexData = 4, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

}  // namespace dkb::bag
