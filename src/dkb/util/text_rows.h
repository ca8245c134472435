// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace dkb {

// Calls `row(place, columns)` for every line of a text of white-space separated columns that is neither blank nor a
// comment (`#`). `place` is `name:line`. Lines may end with LF or CRLF; a UTF-8 byte order mark is skipped.
void for_each_row(
    std::string_view text, const std::string& name,
    const std::function<void(const std::string& place, const std::vector<std::string_view>& columns)>& row);

// A number whose amount is below `limit`, else InputError `place: what "text" is not a number`.
double read_number(std::string_view text, const std::string& place, const std::string& what,
                   double limit = std::numeric_limits<double>::infinity());

}  // namespace dkb
