// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace dkb {

// CRC-32C (Castagnoli polynomial, reflected), as in iSCSI (RFC 3720): "123456789" gives 0xE3069283.
uint32_t crc32c(std::string_view bytes, uint32_t crc = 0);

// What ByteWriter::zigzag() made of a signed number, turned back.
inline int64_t signed_of(uint64_t zigzag) {
  return static_cast<int64_t>(zigzag >> 1) ^ -static_cast<int64_t>(zigzag & 1);
}

// Appends numbers to a string, little-endian whatever the machine.
class ByteWriter {
 public:
  void u8(uint8_t v) { bytes_.push_back(static_cast<char>(v)); }
  void u32(uint32_t v) { fixed(v); }
  void u64(uint64_t v) { fixed(v); }
  void i32(int32_t v) { fixed(static_cast<uint32_t>(v)); }
  void f32(float v) { fixed(std::bit_cast<uint32_t>(v)); }
  void f64(double v) { fixed(std::bit_cast<uint64_t>(v)); }
  // 7 bits per byte, low ones first; the top bit says that more follow.
  void varint(uint64_t v) {
    for (; v >= 0x80; v >>= 7) u8(static_cast<uint8_t>(v | 0x80));
    u8(static_cast<uint8_t>(v));
  }
  // Signed numbers near 0 of either sign become small: 0, -1, 1, -2, ... -> 0, 1, 2, 3, ...
  void zigzag(int64_t v) { varint((static_cast<uint64_t>(v) << 1) ^ static_cast<uint64_t>(v >> 63)); }
  void raw(std::string_view v) { bytes_.append(v); }

  void reserve(size_t size) { bytes_.reserve(size); }
  const std::string& bytes() const { return bytes_; }
  std::string take() { return std::exchange(bytes_, {}); }  // what was written; goes on empty

 private:
  template <class T>
  void fixed(T v) {
    char b[sizeof(T)];
    for (size_t i = 0; i < sizeof(T); ++i) b[i] = static_cast<char>(v >> (8 * i));
    bytes_.append(b, sizeof(T));
  }
  std::string bytes_;
};

// Reads what ByteWriter wrote, from bytes that may be anything. Throws InputError, without a file name, at the end of
// the bytes and for numbers that are too long.
class ByteReader {
 public:
  // `what` names the bytes in messages: "section KEYF". The bytes must outlive the reader.
  ByteReader(std::string_view bytes, std::string what) : rest_(bytes), what_(std::move(what)) {}

  uint8_t u8() { return static_cast<uint8_t>(raw(1)[0]); }
  uint32_t u32() { return fixed<uint32_t>(); }
  uint64_t u64() { return fixed<uint64_t>(); }
  int32_t i32() { return static_cast<int32_t>(fixed<uint32_t>()); }
  double f64() { return std::bit_cast<double>(fixed<uint64_t>()); }
  uint64_t varint();
  int64_t zigzag() { return signed_of(varint()); }
  std::string_view raw(size_t size);
  // A number of items that follow, each of at least `min_bytes` bytes (> 0): more cannot be there.
  size_t count(uint64_t claimed, size_t min_bytes) const;

  size_t left() const { return rest_.size(); }
  void expect_end() const;
  [[noreturn]] void fail(const std::string& why) const;

 private:
  template <class T>
  T fixed() {
    const std::string_view b = raw(sizeof(T));
    T v = 0;
    for (size_t i = 0; i < sizeof(T); ++i) v |= static_cast<T>(static_cast<uint8_t>(b[i])) << (8 * i);
    return v;
  }
  std::string_view rest_;
  std::string what_;
};

}  // namespace dkb
