// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/entropy_coder.h"

#include <algorithm>
#include <array>
#include <bit>

namespace dkb {
namespace {

constexpr size_t kBlock = 1 << 16;
constexpr uint32_t kBits = 12;
constexpr uint32_t kTotal = 1u << kBits;  // sum of the frequencies
constexpr uint32_t kLow = 1u << 16;       // the coder's state stays in [kLow, 2^32)
enum : uint8_t { kStored = 0, kCoded = 1 };

using Frequencies = std::array<uint32_t, 256>;

// Scales counts to the sum kTotal, at least 1 for every byte that occurs.
Frequencies scaled(const Frequencies& counts, size_t total) {
  Frequencies f{};
  uint32_t sum = 0;
  for (size_t s = 0; s < 256; ++s) {
    if (counts[s] == 0) continue;
    f[s] = std::max<uint32_t>(1, static_cast<uint32_t>(static_cast<uint64_t>(counts[s]) * kTotal / total));
    sum += f[s];
  }
  // The largest takes the rest, or gives what the rounding up took; one step at a time, since it may change.
  while (sum != kTotal) {
    const auto largest = std::max_element(f.begin(), f.end());
    if (sum < kTotal) {
      *largest += kTotal - sum;
      sum = kTotal;
    } else {
      --*largest;
      --sum;
    }
  }
  return f;
}

std::string encoded(std::string_view block) {
  Frequencies counts{};
  for (char c : block) ++counts[static_cast<uint8_t>(c)];
  const Frequencies f = scaled(counts, block.size());
  std::array<uint32_t, 256> start{};
  for (size_t s = 1; s < 256; ++s) start[s] = start[s - 1] + f[s - 1];

  ByteWriter table;
  for (size_t s = 0; s < 256; s += 8) {
    uint8_t mask = 0;
    for (size_t b = 0; b < 8; ++b) mask = static_cast<uint8_t>(mask | (f[s + b] > 0 ? 1u << b : 0u));
    table.u8(mask);
  }
  for (uint32_t v : f)
    if (v > 0) table.varint(v);

  // The coder is a stack: what goes in last comes out first.
  std::vector<uint16_t> words;
  words.reserve(block.size() / 2 + 2);
  uint32_t x = kLow;
  for (size_t i = block.size(); i-- > 0;) {
    const auto s = static_cast<uint8_t>(block[i]);
    if (static_cast<uint64_t>(x) >= static_cast<uint64_t>(f[s]) << (32 - kBits)) {
      words.push_back(static_cast<uint16_t>(x));
      x >>= 16;
    }
    x = ((x / f[s]) << kBits) + x % f[s] + start[s];
  }
  table.u32(x);
  std::string code = table.bytes();
  code.reserve(code.size() + 2 * words.size());
  for (size_t i = words.size(); i-- > 0;) {
    code.push_back(static_cast<char>(words[i]));
    code.push_back(static_cast<char>(words[i] >> 8));
  }
  return code;
}

void decode(ByteReader& in, std::string_view code, size_t size, std::string& out) {
  ByteReader table(code, "a packed block");
  const std::string_view masks = table.raw(32);
  struct Step {
    uint16_t frequency;
    uint16_t offset;  // of the slot within the byte's range
    uint8_t byte;
  };
  std::vector<Step> steps;
  steps.reserve(kTotal);
  for (size_t s = 0; s < 256; ++s) {
    if (((static_cast<uint8_t>(masks[s / 8]) >> (s % 8)) & 1) == 0) continue;
    const uint64_t f = table.varint();
    if (f == 0 || f > kTotal - steps.size()) in.fail("has a damaged table of frequencies");
    for (uint16_t i = 0; i < f; ++i) steps.push_back({static_cast<uint16_t>(f), i, static_cast<uint8_t>(s)});
  }
  if (steps.size() != kTotal) in.fail("has a damaged table of frequencies");
  uint32_t x = table.u32();
  const std::string_view words = table.raw(table.left());
  if (x < kLow || words.size() % 2 != 0) in.fail("has a damaged packed block");
  size_t next = 0;
  for (size_t i = 0; i < size; ++i) {
    const Step step = steps[x & (kTotal - 1)];
    out.push_back(static_cast<char>(step.byte));
    x = step.frequency * (x >> kBits) + step.offset;
    if (x < kLow) {
      if (next == words.size()) in.fail("has a packed block that ends too early");
      x = x << 16 | static_cast<uint32_t>(static_cast<uint8_t>(words[next])) |
          static_cast<uint32_t>(static_cast<uint8_t>(words[next + 1])) << 8;
      next += 2;
    }
  }
  if (x != kLow || next != words.size()) in.fail("has a packed block that does not end where it should");
}

}  // namespace

void write_packed(ByteWriter& out, std::string_view bytes) {
  for (size_t i = 0; i < bytes.size(); i += kBlock) {
    const std::string_view block = bytes.substr(i, kBlock);
    const std::string code = encoded(block);
    if (code.size() + 4 < block.size()) {
      out.u8(kCoded);
      out.u32(static_cast<uint32_t>(code.size()));
      out.raw(code);
    } else {
      out.u8(kStored);
      out.raw(block);
    }
  }
}

std::string read_packed(ByteReader& in, size_t size) {
  std::string out;
  out.reserve(size);
  while (out.size() < size) {
    const size_t block = std::min(kBlock, size - out.size());
    const uint8_t mode = in.u8();
    if (mode == kStored) {
      out.append(in.raw(block));
    } else if (mode == kCoded) {
      const uint32_t length = in.u32();
      decode(in, in.raw(length), block, out);
    } else {
      in.fail("has a packed block of an unknown kind");
    }
  }
  return out;
}

void write_packed_words(ByteWriter& out, std::span<const uint32_t> words) {
  std::string plane(words.size(), '\0');
  for (unsigned shift = 0; shift < 32; shift += 8) {
    for (size_t i = 0; i < words.size(); ++i) plane[i] = static_cast<char>(words[i] >> shift);
    write_packed(out, plane);
  }
}

std::vector<uint32_t> read_packed_words(ByteReader& in, size_t count) {
  std::vector<uint32_t> words(count, 0);
  for (unsigned shift = 0; shift < 32; shift += 8) {
    const std::string plane = read_packed(in, count);
    for (size_t i = 0; i < count; ++i) words[i] |= static_cast<uint32_t>(static_cast<uint8_t>(plane[i])) << shift;
  }
  return words;
}

void write_packed_floats(ByteWriter& out, std::span<const float> values) {
  std::vector<uint32_t> words(values.size());
  std::transform(values.begin(), values.end(), words.begin(), [](float v) { return std::bit_cast<uint32_t>(v); });
  write_packed_words(out, words);
}

std::vector<float> read_packed_floats(ByteReader& in, size_t count) {
  const std::vector<uint32_t> words = read_packed_words(in, count);
  std::vector<float> values(count);
  std::transform(words.begin(), words.end(), values.begin(), [](uint32_t w) { return std::bit_cast<float>(w); });
  return values;
}

}  // namespace dkb
