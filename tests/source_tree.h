// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dkb::test {

std::filesystem::path source_dir();

// The lines of a text file, without line ends. Throws std::runtime_error when it cannot be read.
std::vector<std::string> read_lines(const std::filesystem::path& file);

// The words of a line, split at white space.
std::vector<std::string> words(const std::string& line);

// Files below source_dir()/folder whose extension is one of `extensions`, as sorted paths relative to source_dir().
std::vector<std::string> files_below(const std::string& folder, const std::vector<std::string>& extensions);

// The rooms in their order, bottom to top, as src/dkb/CMakeLists.txt lists them.
std::vector<std::string> rooms_bottom_to_top();

}  // namespace dkb::test
