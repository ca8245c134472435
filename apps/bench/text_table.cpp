// SPDX-License-Identifier: Apache-2.0
#include "bench/text_table.h"

#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {

std::string markdown_cell(const std::string& text) {
  std::string out;
  for (const char c : one_line(text)) {
    if (c == '|') out += '\\';
    out += c;
  }
  return out;
}

std::string markdown_row(const std::vector<std::string>& cells) {
  std::string out = "|";
  for (const std::string& cell : cells) out += " " + markdown_cell(cell) + " |";
  return out + "\n";
}

}  // namespace

std::string markdown_table(const TextTable& table) {
  std::string out = markdown_row(table.header) + "|";
  for (size_t c = 0; c < table.header.size(); ++c) out += c < table.text_columns ? "---|" : "---:|";
  out += "\n";
  for (const auto& row : table.rows) out += markdown_row(row);
  return out;
}

std::string html_table(const TextTable& table) {
  const auto row_of = [&](const std::vector<std::string>& cells, const std::string& tag) {
    std::string out = "<tr>";
    for (size_t c = 0; c < cells.size(); ++c)
      out +=
          "<" + tag + (c < table.text_columns ? "" : " class=\"n\"") + ">" + svg::escaped(cells[c]) + "</" + tag + ">";
    return out + "</tr>\n";
  };
  std::string out = "<table>\n<thead>\n" + row_of(table.header, "th") + "</thead>\n<tbody>\n";
  for (const auto& row : table.rows) out += row_of(row, "td");
  return out + "</tbody>\n</table>\n";
}

}  // namespace dkb
