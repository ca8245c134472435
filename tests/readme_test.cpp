// SPDX-License-Identifier: Apache-2.0
// The README is the first thing that a stranger tries: its commands, options and files must exist.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

#include "source_tree.h"

namespace dkb::test {
namespace {

// Lines of the README's shell blocks, with continued lines joined and comments cut off.
std::vector<std::string> readme_commands() {
  std::vector<std::string> commands;
  bool in_shell = false, continued = false;
  for (std::string line : read_lines(source_dir() / "README.md")) {
    if (line.rfind("```", 0) == 0) {
      in_shell = line == "```sh";
      continue;
    }
    if (!in_shell) continue;
    line = line.substr(0, line.find(" #"));
    if (continued) {
      commands.back() += line;
    } else {
      commands.push_back(line);
    }
    continued = !line.empty() && line.back() == '\\';
    if (continued) commands.back().back() = ' ';
  }
  return commands;
}

TEST(Readme, MakeTargetsExist) {
  std::set<std::string> targets;
  const std::regex target("^([a-z-]+):.*");
  for (const std::string& line : read_lines(source_dir() / "Makefile")) {
    std::smatch match;
    if (std::regex_match(line, match, target)) targets.insert(match[1]);
  }
  std::set<std::string> named;
  for (const std::string& command : readme_commands()) {
    const std::vector<std::string> word = words(command);
    if (word.size() < 2 || word[0] != "make") continue;
    named.insert(word[1]);
    EXPECT_TRUE(targets.count(word[1])) << "README.md: `" << command << "`: the Makefile has no such target";
  }
  EXPECT_TRUE(named.count("demo") && named.count("test")) << "README.md must show `make demo` and `make test`";
}

TEST(Readme, LinkedFilesExist) {
  const std::regex link("\\]\\(([^)#:]+)(#[^)]*)?\\)");
  for (const std::string& line : read_lines(source_dir() / "README.md")) {
    for (std::sregex_iterator it(line.begin(), line.end(), link), end; it != end; ++it) {
      EXPECT_TRUE(std::filesystem::exists(source_dir() / (*it)[1].str())) << "README.md links to " << (*it)[1];
    }
  }
}

#ifdef DKB_SLAM_EXECUTABLE
std::string output_of(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (!pipe) return "";
  std::string output;
  std::array<char, 4096> buffer;
  for (size_t n = 0; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) output.append(buffer.data(), n);
  pclose(pipe);
  return output;
}

TEST(Readme, OptionsOfTheCommandLineExist) {
  int seen = 0;
  for (const std::string& command : readme_commands()) {
    const std::vector<std::string> word = words(command);
    if (word.size() < 2 || std::filesystem::path(word[0]).filename() != "dkb-slam") continue;
    ++seen;
    // `map` has commands of its own.
    const std::string name_of_command = word[1] == "map" && word.size() > 2 ? word[1] + " " + word[2] : word[1];
    const std::string help = output_of(std::string("\"") + DKB_SLAM_EXECUTABLE + "\" " + name_of_command + " --help");
    for (const std::string& option : word) {
      if (option.rfind("--", 0) != 0) continue;
      const std::string name = option.substr(0, option.find('='));
      EXPECT_TRUE(std::regex_search(help, std::regex(name + "\\b")))
          << "README.md: `" << command << "`: `dkb-slam " << name_of_command << " --help` does not mention " << name;
    }
  }
  EXPECT_GT(seen, 0) << "README.md shows no dkb-slam command";
}

TEST(Files, TheSceneOfThePageCanBeDrawn) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_page_scene");
  std::filesystem::create_directories(folder);
  std::ofstream scene(folder / "scene.yaml");
  bool inside = false;
  for (const std::string& line : read_lines(source_dir() / "docs/files.md")) {
    if (line.starts_with("```")) inside = line == "```yaml";
    if (inside && !line.starts_with("```")) scene << line << '\n';
  }
  scene.close();
  const std::string output =
      output_of(std::string("\"") + DKB_SLAM_EXECUTABLE + "\" simulate --frames 1 --scene \"" +
                (folder / "scene.yaml").string() + "\" --out \"" + (folder / "out").string() + "\"");
  EXPECT_NE(output.find(": 1 frame of scene"), std::string::npos) << output;
  std::filesystem::remove_all(folder);
}
#endif

}  // namespace
}  // namespace dkb::test
