// SPDX-License-Identifier: Apache-2.0
#include "source_tree.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace dkb::test {

std::filesystem::path source_dir() {
  return DKB_SOURCE_DIR;
}

std::vector<std::string> read_lines(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> words(const std::string& line) {
  std::istringstream in(line);
  return {std::istream_iterator<std::string>(in), {}};
}

std::vector<std::string> files_below(const std::string& folder, const std::vector<std::string>& extensions) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(source_dir() / folder)) {
    const bool wanted = std::find(extensions.begin(), extensions.end(), entry.path().extension()) != extensions.end();
    if (entry.is_regular_file() && wanted) files.push_back(entry.path().lexically_relative(source_dir()).string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> rooms_bottom_to_top() {
  const std::regex list("foreach\\(room ([a-z_ ]+)\\)");
  for (const std::string& line : read_lines(source_dir() / "src/dkb/CMakeLists.txt")) {
    std::smatch match;
    if (std::regex_search(line, match, list)) return words(match[1]);
  }
  throw std::runtime_error("src/dkb/CMakeLists.txt has no line `foreach(room ...)` that lists the rooms");
}

}  // namespace dkb::test
