// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "dkb/recordings/message_stream.h"

namespace dkb {

// Reads the fields of one message in their order, whichever way they are laid out: packed and little-endian (ROS 1), or
// aligned and in the byte order that the message names (CDR of ROS 2). Throws InputError, without a name, when the
// bytes end too early. What it returns points into the bytes.
class MessageReader {
 public:
  MessageReader(std::string_view bytes, MessageEncoding encoding);

  MessageEncoding encoding() const { return encoding_; }
  size_t left() const { return bytes_.size() - at_; }

  uint8_t u8() { return fixed<uint8_t>(); }
  bool boolean() { return u8() != 0; }
  uint32_t u32() { return fixed<uint32_t>(); }
  double f64() { return std::bit_cast<double>(fixed<uint64_t>()); }
  template <class Numbers>
  void f64s(Numbers* numbers) {  // of a fixed or known count
    for (double& number : *numbers) number = f64();
  }
  int64_t stamp_ns();
  std::string_view text();
  std::string_view bytes();  // of a sequence of uint8
  // Number of elements of a sequence, each of which takes at least `smallest` bytes.
  size_t count(size_t smallest);

 private:
  std::string_view raw(size_t size);
  template <class T>
  T fixed() {
    if (const size_t align = std::min(sizeof(T), max_align_); align > 1) {
      const size_t beyond = (at_ - origin_) % align;
      if (beyond != 0) raw(align - beyond);
    }
    const std::string_view in = raw(sizeof(T));
    T value = 0;
    for (size_t i = 0; i < sizeof(T); ++i)
      value = static_cast<T>(value | static_cast<T>(static_cast<T>(static_cast<uint8_t>(in[i]))
                                                    << (8 * (big_endian_ ? sizeof(T) - 1 - i : i))));
    return value;
  }

  std::string_view bytes_;
  MessageEncoding encoding_;
  size_t at_ = 0, origin_ = 0;  // alignment counts from origin_
  size_t max_align_ = 1;
  bool big_endian_ = false;
};

}  // namespace dkb
