// SPDX-License-Identifier: Apache-2.0
// What users get: few headers that show nothing of the library's inside, and a shared library that shows what they
// name.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <regex>
#include <set>
#include <sstream>

#include "dkb_slam/version.h"
#include "source_tree.h"

namespace dkb::test {
namespace {

std::vector<std::string> output_lines(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return {};
  std::string output;
  std::array<char, 4096> buffer;
  for (size_t n = 0; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) output.append(buffer.data(), n);
  EXPECT_EQ(pclose(pipe), 0) << command;
  std::vector<std::string> lines;
  std::istringstream in(output);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Names of the classes and functions that the public headers mark with DKB_SLAM_API.
std::set<std::string> marked_names() {
  const std::regex marked("^(?:(?:class|struct) DKB_SLAM_API ([A-Za-z0-9_]+)|DKB_SLAM_API [^(]*?([A-Za-z0-9_]+)\\()");
  std::set<std::string> names;
  for (const std::string& file : files_below("include/dkb_slam", {".h"})) {
    for (const std::string& line : read_lines(source_dir() / file)) {
      std::smatch match;
      if (std::regex_search(line, match, marked)) names.insert(match[match[1].matched ? 1 : 2]);
    }
  }
  return names;
}

TEST(Package, SharedLibraryExportsNothingOfOursThatTheHeadersDoNotMark) {
  const std::set<std::string> names = marked_names();
  ASSERT_TRUE(names.count("Slam") && names.count("InputError") && names.count("open_folder") && names.count("name_of"));
  // Instances of the standard library's templates with our types are the standard library's.
  const std::regex symbol("^[0-9a-f]+ [A-Za-z] (?:[a-z -]+ (?:for|to) )?dkb::([A-Za-z0-9_]+)(.*)$");
  std::set<std::string> seen;
  for (const std::string& line : output_lines("nm -DC --defined-only \"" DKB_SHARED_LIBRARY "\"")) {
    std::smatch match;
    if (!std::regex_match(line, match, symbol)) continue;
    EXPECT_TRUE(names.count(match[1])) << line;
    EXPECT_NE(match[2].str().rfind("::Impl", 0), 0U) << line;
    seen.insert(match[1]);
  }
  for (const char* name : {"Slam", "InputError", "open_folder", "name_of", "version"})
    EXPECT_TRUE(seen.count(name)) << name;
}

// Before version 1.0 a minor version may change the binary interface.
TEST(Package, SonameCarriesMajorAndMinorVersion) {
  const std::string soname =
      "libdkb_slam.so." + std::to_string(DKB_SLAM_VERSION_MAJOR) + "." + std::to_string(DKB_SLAM_VERSION_MINOR);
  int seen = 0;
  for (const std::string& line : output_lines("readelf -d \"" DKB_SHARED_LIBRARY "\""))
    seen += line.find("SONAME") != std::string::npos && line.find("[" + soname + "]") != std::string::npos;
  EXPECT_EQ(seen, 1) << soname;
}

TEST(Package, OneVersionStandsInHeaderCitationAndChangelog) {
  const std::string numbers = std::to_string(DKB_SLAM_VERSION_MAJOR) + "." + std::to_string(DKB_SLAM_VERSION_MINOR) +
                              "." + std::to_string(DKB_SLAM_VERSION_PATCH);
  EXPECT_EQ(numbers, DKB_SLAM_VERSION);
  const auto holds = [](const std::string& file, const std::string& start) {
    for (const std::string& line : read_lines(source_dir() / file))
      if (line.rfind(start, 0) == 0) return true;
    return false;
  };
  EXPECT_TRUE(holds("CITATION.cff", "version: " + numbers));
  EXPECT_TRUE(holds("CHANGELOG.md", "## [" + numbers + "]"));
}

TEST(Package, ExamplesAreShort) {
  for (const std::string& file : files_below("examples", {".cpp"}))
    EXPECT_LE(read_lines(source_dir() / file).size(), 45U) << file;
}

}  // namespace
}  // namespace dkb::test
