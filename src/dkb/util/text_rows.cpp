// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/text_rows.h"

#include <cmath>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"

namespace dkb {

void for_each_row(std::string_view text, const std::string& name,
                  const std::function<void(const std::string&, const std::vector<std::string_view>&)>& row) {
  constexpr std::string_view kSpace = " \t\r\v\f";
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  std::vector<std::string_view> columns;
  for (size_t line_number = 1; !text.empty(); ++line_number) {
    const size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    columns.clear();
    for (;;) {
      const size_t first = line.find_first_not_of(kSpace);
      if (first == std::string_view::npos) break;
      line.remove_prefix(first);
      const std::string_view column = line.substr(0, line.find_first_of(kSpace));
      columns.push_back(column);
      line.remove_prefix(column.size());
    }
    if (!columns.empty() && columns.front().front() != '#') row(name + ":" + std::to_string(line_number), columns);
  }
}

double read_number(std::string_view text, const std::string& place, const std::string& what, double limit) {
  double value = 0;
  if (!parse_number(text, &value)) throw InputError(place + ": " + what + " \"" + excerpt(text) + "\" is not a number");
  if (!(std::abs(value) < limit))
    throw InputError(place + ": " + what + " \"" + excerpt(text) + "\" is not a finite number" +
                     (std::isfinite(limit) ? " in range" : ""));
  return value;
}

}  // namespace dkb
