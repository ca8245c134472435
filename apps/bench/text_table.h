// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace dkb {

// A table of words, written alike for people's editors and browsers.
struct TextTable {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  // each as long as the header
  size_t text_columns = 1;                     // so many from the left hold words; the others numbers, set to the right
};

// A table of GitHub's Markdown; bars and line breaks in cells are escaped.
std::string markdown_table(const TextTable& table);
// <table>...</table>; markup in cells is escaped.
std::string html_table(const TextTable& table);

}  // namespace dkb
