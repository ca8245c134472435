// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

// The numbers of the mcap format (mcap.dev/spec) that its reader and its writer share.
namespace dkb::mcap {

constexpr std::string_view kMagic = "\x89MCAP0\r\n";
constexpr uint64_t kRecordStart = 9;  // [bytes] kind and size of a record
constexpr uint64_t kFooterSize = 20;
constexpr size_t kMessageStart = 22;  // [bytes] of a message record before the message

enum Op : uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kMetadata = 12,
  kMetadataIndex = 13,
  kSummaryOffset = 14,
  kDataEnd = 15,
};

}  // namespace dkb::mcap
