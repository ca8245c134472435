// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/byte_stream.h"

#include <array>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

// tables[k][b]: what byte b does to the checksum when k more bytes follow it, so that eight bytes go in one step.
constexpr std::array<std::array<uint32_t, 256>, 8> make_tables() {
  std::array<std::array<uint32_t, 256>, 8> tables{};
  for (uint32_t b = 0; b < 256; ++b) {
    uint32_t c = b;
    for (int i = 0; i < 8; ++i) c = (c >> 1) ^ ((c & 1) != 0 ? 0x82F63B78u : 0u);
    tables[0][b] = c;
  }
  for (size_t k = 1; k < 8; ++k)
    for (size_t b = 0; b < 256; ++b) tables[k][b] = (tables[k - 1][b] >> 8) ^ tables[0][tables[k - 1][b] & 0xFF];
  return tables;
}
constexpr auto kTables = make_tables();

}  // namespace

uint32_t crc32c(std::string_view bytes, uint32_t crc) {
  const auto at = [&](size_t i) { return static_cast<uint8_t>(bytes[i]); };
  uint32_t c = ~crc;
  size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    c = kTables[7][(c ^ at(i)) & 0xFF] ^ kTables[6][((c >> 8) ^ at(i + 1)) & 0xFF] ^
        kTables[5][((c >> 16) ^ at(i + 2)) & 0xFF] ^ kTables[4][((c >> 24) ^ at(i + 3)) & 0xFF] ^
        kTables[3][at(i + 4)] ^ kTables[2][at(i + 5)] ^ kTables[1][at(i + 6)] ^ kTables[0][at(i + 7)];
  }
  for (; i < bytes.size(); ++i) c = (c >> 8) ^ kTables[0][(c ^ at(i)) & 0xFF];
  return ~c;
}

uint64_t ByteReader::varint() {
  uint64_t v = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    const uint8_t b = u8();
    if (shift == 63 && b > 1) break;
    v |= static_cast<uint64_t>(b & 0x7F) << shift;
    if (b < 0x80) {
      if (b == 0 && shift > 0) break;  // one way of writing a number only
      return v;
    }
  }
  fail("holds a malformed number");
}

std::string_view ByteReader::raw(size_t size) {
  if (size > rest_.size()) fail("ends too early");
  const std::string_view taken = rest_.substr(0, size);
  rest_.remove_prefix(size);
  return taken;
}

size_t ByteReader::count(uint64_t claimed, size_t min_bytes) const {
  if (claimed > rest_.size() / min_bytes) fail("claims more items than it can hold");
  return static_cast<size_t>(claimed);
}

void ByteReader::expect_end() const {
  if (!rest_.empty()) fail("is longer than its content");
}

void ByteReader::fail(const std::string& why) const {
  throw InputError(what_ + " " + why);
}

}  // namespace dkb
