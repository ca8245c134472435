// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/message_reader.h"

#include "dkb/util/errors.h"

namespace dkb {

MessageReader::MessageReader(std::string_view bytes, MessageEncoding encoding) : bytes_(bytes), encoding_(encoding) {
  if (encoding == MessageEncoding::ros1) return;
  // Two bytes tell the representation, two more are options.
  const std::string_view header = raw(4);
  const unsigned kind = static_cast<uint8_t>(header[0]) * 256U + static_cast<uint8_t>(header[1]);
  origin_ = at_;
  if (kind != 0 && kind != 1 && kind != 6 && kind != 7)
    throw InputError("its CDR representation is " + std::to_string(kind) +
                     "; 0, 1 (plain CDR), 6 and 7 (plain CDR2) are read");
  big_endian_ = kind % 2 == 0;
  max_align_ = kind < 2 ? 8 : 4;
}

std::string_view MessageReader::raw(size_t size) {
  if (size > left())
    throw InputError("it ends too early: " + std::to_string(size) + " bytes are wanted where " +
                     std::to_string(left()) + " are left");
  const std::string_view bytes = bytes_.substr(at_, size);
  at_ += size;
  return bytes;
}

int64_t MessageReader::stamp_ns() {
  const uint32_t seconds = u32(), ns = u32();
  // ROS 2 counts seconds with a sign.
  const int64_t whole = encoding_ == MessageEncoding::cdr ? static_cast<int32_t>(seconds) : int64_t{seconds};
  return whole * 1'000'000'000 + ns;
}

std::string_view MessageReader::text() {
  std::string_view text = raw(u32());
  // CDR counts the zero at the end.
  if (encoding_ == MessageEncoding::cdr && !text.empty() && text.back() == '\0') text.remove_suffix(1);
  return text;
}

std::string_view MessageReader::bytes() {
  return raw(u32());
}

size_t MessageReader::count(size_t smallest) {
  const size_t count = u32();
  if (count > left() / std::max<size_t>(smallest, 1))
    throw InputError("it ends too early: " + std::to_string(count) + " elements are announced where " +
                     std::to_string(left()) + " bytes are left");
  return count;
}

}  // namespace dkb
