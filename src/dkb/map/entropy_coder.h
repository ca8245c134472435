// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/map/byte_stream.h"

namespace dkb {

// Lossless coding of bytes by their frequencies: range asymmetric numeral systems (Duda, arXiv 1311.2540) with 12-bit
// frequencies, in blocks of 64 KiB with a table each; a block that would grow is stored as it is. All integer
// arithmetic: the same bytes give the same code on every machine.
void write_packed(ByteWriter& out, std::string_view bytes);

// The `size` bytes that write_packed() was given. Throws InputError when the code is damaged. The caller bounds `size`.
std::string read_packed(ByteReader& in, size_t size);

// 32-bit words as four packed planes of bytes: the sign and exponent of floats of one kind are much alike, so their
// plane packs well although the words do not.
void write_packed_words(ByteWriter& out, std::span<const uint32_t> words);
std::vector<uint32_t> read_packed_words(ByteReader& in, size_t count);

void write_packed_floats(ByteWriter& out, std::span<const float> values);
std::vector<float> read_packed_floats(ByteReader& in, size_t count);

}  // namespace dkb
