// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace dkb {

// OpenNI's compression of depth images ("16zP", with a table of values in front "16zT"): differences between
// neighbours in half bytes. Throws InputError `name: reason` unless the bytes give exactly `pixels` values.
std::vector<uint16_t> decode_16z(std::span<const uint8_t> bytes, size_t pixels, bool with_table,
                                 const std::string& name);

}  // namespace dkb
