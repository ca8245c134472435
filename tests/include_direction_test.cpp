// SPDX-License-Identifier: Apache-2.0
// The architecture as a test: an include points down, and what the library must not do is not in it.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <regex>

#include "source_tree.h"

namespace dkb::test {
namespace {

const std::vector<std::string> kCpp = {".cpp", ".h"};

// Room of a path such as src/dkb/map/keyframe.h, or of an include such as dkb/map/keyframe.h.
std::string room_of(const std::string& path) {
  static const std::regex room("^(?:src/)?dkb/([^/]+)/");
  std::smatch match;
  return std::regex_search(path, match, room) ? match[1].str() : "";
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// Every #include of every source file of the library: calls check(file, "file:line", name, quoted).
template <class Check>
void for_each_include(const Check& check) {
  const std::regex include("^\\s*#\\s*include\\s*([<\"])([^>\"]+)[>\"]");
  for (const std::string& file : files_below("src/dkb", kCpp)) {
    const std::vector<std::string> lines = read_lines(source_dir() / file);
    for (size_t i = 0; i < lines.size(); ++i) {
      std::smatch match;
      if (!std::regex_search(lines[i], match, include)) continue;
      check(file, file + ":" + std::to_string(i + 1), match[2].str(), match[1] == "\"");
    }
  }
}

TEST(Architecture, EveryFolderOfTheLibraryIsAListedRoom) {
  const std::vector<std::string> rooms = rooms_bottom_to_top();
  ASSERT_GE(rooms.size(), 3u);
  for (const std::string& file : files_below("src/dkb", kCpp)) {
    EXPECT_EQ(std::count(rooms.begin(), rooms.end(), room_of(file)), 1)
        << file << " is in no room that src/dkb/CMakeLists.txt lists";
  }
}

TEST(Architecture, IncludesPointDown) {
  std::map<std::string, int> height;
  for (const std::string& room : rooms_bottom_to_top()) height.emplace(room, static_cast<int>(height.size()));
  int seen = 0;
  for_each_include([&](const std::string& file, const std::string& where, const std::string& name, bool quoted) {
    if (!quoted) return;
    ++seen;
    const std::string to = room_of(name);
    if (name.rfind("dkb_slam/", 0) == 0) {
      // What users see is the ground floor, but for the front doors, which open into slam and what stands above it.
      const bool door = name == "dkb_slam/slam.h" || name == "dkb_slam/source.h";
      if (door) {
        EXPECT_GE(height[room_of(file)], height["slam"]) << where << " includes " << name;
      }
      return;
    }
    ASSERT_TRUE(height.count(to)) << where << ": \"" << name << "\" is not written as dkb/ROOM/FILE";
    EXPECT_LE(height[to], height[room_of(file)])
        << where << ": room " << room_of(file) << " must not include " << name << ", which stands above it";
  });
  EXPECT_GT(seen, 0);
}

TEST(Architecture, PublicHeadersKnowNothingOfTheRooms) {
  const std::vector<std::string> headers = files_below("include", kCpp);
  EXPECT_GE(headers.size(), 1u);
  EXPECT_LE(headers.size(), 12u) << "few headers are a promise to users";
  for (const std::string& header : headers)
    for (const std::string& line : read_lines(source_dir() / header))
      EXPECT_EQ(line.find("#include \"dkb/"), std::string::npos) << header << ": " << line;
}

// Mapping and loop search work beside tracking and talk to it in packets; the simulator is for tests and benches.
TEST(Architecture, MappingAndLoopsKnowNothingOfTrackingAndTheLibraryNothingOfTheSimulator) {
  for_each_include([](const std::string& file, const std::string& where, const std::string& name, bool) {
    const std::string from = room_of(file), to = room_of(name);
    if (from == "mapping" || from == "loop") {
      EXPECT_NE(to, "tracking") << where << " includes " << name;
    }
    if (from != "simulator") {
      EXPECT_NE(to, "simulator") << where << " includes " << name;
    }
  });
}

// OpenCV serves tests as a reference, and a detector that the build can leave out.
TEST(Architecture, TheLibraryDoesNotIncludeOpenCv) {
  for_each_include([](const std::string& file, const std::string& where, const std::string& name, bool) {
    if (ends_with(file, "_test.cpp") || room_of(file) == "detection") return;
    EXPECT_NE(name.rfind("opencv2/", 0), 0u) << where << " includes " << name;
  });
}

TEST(Architecture, TheLibraryNeitherSleepsNorExitsNorTunesForOneMachine) {
  const std::regex banned(
      "sleep_for|sleep_until|\\busleep\\(|std::exit|std::abort|std::terminate\\(|[^_a-z]exit\\(|march="
      "native");
  for (const std::string& file : files_below("src", {".cpp", ".h", ".txt", ".cmake"})) {
    const std::vector<std::string> lines = read_lines(source_dir() / file);
    for (size_t i = 0; i < lines.size(); ++i) {
      std::smatch match;
      EXPECT_FALSE(std::regex_search(lines[i], match, banned)) << file << ":" << i + 1 << " has " << match.str();
    }
  }
}

// `head` ends before what feeds it: now and then that dies of SIGPIPE, and with pipefail the script with it.
TEST(Architecture, ScriptsDoNotReadTheBeginningOfAPipeAlone) {
  for (const std::string& file : files_below("scripts", {".sh"}))
    for (const std::string& line : read_lines(source_dir() / file))
      EXPECT_FALSE(std::regex_search(line, std::regex("\\|\\s*head\\b"))) << file << ": " << line << ": use sed -n 1p";
}

TEST(Architecture, EverySourceFileNamesItsLicence) {
  for (const std::string folder : {"src", "apps", "tests", "examples", "bench", "cmake", "fuzz", "python", "ros"}) {
    for (const std::string& file : files_below(folder, {".cpp", ".h", ".txt", ".cmake", ".py", ".pyi"})) {
      const std::vector<std::string> lines = read_lines(source_dir() / file);
      const size_t first = !lines.empty() && lines[0].starts_with("#!") ? 1 : 0;  // scripts name their interpreter
      EXPECT_TRUE(lines.size() > first && lines[first].find("SPDX-License-Identifier: Apache-2.0") != std::string::npos)
          << file << ": the first line must be the SPDX line";
    }
  }
}

// A hint for the reader of the log, not a failure: a long file often does two jobs.
TEST(Architecture, LongFilesAreNamed) {
  for (const std::string folder : {"src", "apps", "python", "ros", "tests"}) {
    for (const std::string& file : files_below(folder, kCpp)) {
      const size_t lines = read_lines(source_dir() / file).size();
      if (lines > 500) std::cout << "warning: " << file << " has " << lines << " lines; is it still one job?\n";
    }
  }
}

}  // namespace
}  // namespace dkb::test
