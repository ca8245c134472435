// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/oni_codecs.h"

#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Reads bytes; past the end it says so once and gives zeros.
class Bytes {
 public:
  explicit Bytes(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  uint8_t byte() {
    if (at_ < bytes_.size()) return bytes_[at_++];
    overrun_ = true;
    return 0;
  }
  uint16_t little_endian() {
    const uint8_t low = byte();
    return static_cast<uint16_t>(low | byte() << 8);
  }
  bool more() const { return at_ < bytes_.size(); }
  bool overrun() const { return overrun_; }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  bool overrun_ = false;
};

}  // namespace

// A byte below 0xE0 holds two differences to the value before, from -6 to 6, each as 6 more. In the place of the second
// stands 0xD for none, 0xF for a value that follows. 0xE0 + n repeats the last value 2 n times. 0xFF: a value follows.
// What follows is one byte of 0x80 or more for a difference of 192 less, else a whole value, high byte first.
std::vector<uint16_t> decode_16z(std::span<const uint8_t> bytes, size_t pixels, bool with_table,
                                 const std::string& name) {
  const auto broken = [&](const char* reason) {
    throw InputError(name + ": is a broken depth image of OpenNI (" + reason + ")");
  };
  Bytes in(bytes);
  std::vector<uint16_t> table(with_table ? in.little_endian() : 0);
  if (table.size() * 2 > bytes.size()) broken("its table is truncated");
  for (uint16_t& value : table) value = in.little_endian();
  std::vector<uint16_t> out;
  out.reserve(pixels);
  uint16_t last = in.little_endian();
  const auto put = [&] {
    if (with_table && last >= table.size()) broken("a value beyond its table");
    if (out.size() >= pixels) broken("too many pixels");
    out.push_back(with_table ? table[last] : last);
  };
  const auto put_difference = [&](int difference) {
    last = static_cast<uint16_t>(last - difference);
    put();
  };
  const auto put_following = [&] {
    const uint8_t byte = in.byte();
    if (byte >= 0x80) {
      put_difference(byte - 192);
    } else {
      last = static_cast<uint16_t>(byte << 8 | in.byte());
      put();
    }
  };
  put();
  while (in.more()) {
    const uint8_t byte = in.byte();
    if (byte == 0xFF) {
      put_following();
    } else if (byte >= 0xE0) {
      for (int n = 2 * (byte & 0x0F); n > 0; --n) put();
    } else {
      put_difference((byte >> 4) - 6);
      const int second = byte & 0x0F;
      if (second == 0x0F)
        put_following();
      else if (second != 0x0D)
        put_difference(second - 6);
    }
  }
  if (in.overrun()) broken("it is truncated");
  // Half a byte too many at the end, as an odd number of differences leaves it, is no pixel.
  if (out.size() != pixels) broken("too few pixels");
  return out;
}

}  // namespace dkb
