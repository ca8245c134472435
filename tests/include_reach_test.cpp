// SPDX-License-Identifier: Apache-2.0
// Each file of the library reaches the headers of what it uses. Builds that compile several files as one do not see
// what one of them lacks; who builds each file by itself does.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "source_tree.h"

namespace dkb::test {
namespace {

// Without comments and strings, but for the names of includes.
std::string code_of(const std::string& file) {
  static const std::regex string("\"(\\\\.|[^\"\\\\])*\"");
  std::string code;
  for (const std::string& line : read_lines(source_dir() / file)) {
    const bool include = line.rfind("#include", 0) == 0;
    const std::string bare = line.substr(0, line.find("//"));
    code += (include ? bare : std::regex_replace(bare, string, "\"\"")) + "\n";
  }
  return code;
}

// What the first group of `pattern` is, wherever it is met in a line of `code`.
std::set<std::string> found(const std::string& code, const std::string& pattern) {
  const std::regex regex(pattern);
  std::set<std::string> names;
  std::istringstream lines(code);
  for (std::string line; std::getline(lines, line);)
    for (std::sregex_iterator m(line.begin(), line.end(), regex), end; m != end; ++m) names.insert((*m)[1].str());
  return names;
}

// A constant or a name of several words: others of one word are also local ones.
bool telling(const std::string& name) {
  if (name.size() > 1 && name[0] == 'k' && name[1] >= 'A' && name[1] <= 'Z') return true;
  const auto upper = std::count_if(name.begin(), name.end(), [](char c) { return c >= 'A' && c <= 'Z'; });
  return upper == 0 ? name.size() >= 8 && name.find('_') != std::string::npos : upper >= 2;
}

class SourceFiles {
 public:
  // By path below source_dir().
  explicit SourceFiles(std::map<std::string, std::string> code) : code_(std::move(code)) {
    for (const auto& [file, text] : code_)
      for (const std::string& name : found(text, "^#include \"([^\"]+)\""))
        for (const std::string root : {"src/", "include/"})
          if (code_.count(root + name)) includes_[file].insert(root + name);
    for (const auto& [file, text] : code_)
      for (const char* declaration : {"(?:class|struct|enum|using|auto|constexpr [\\w:]+) (\\w+)",
                                      "^ *(?!return|else|throw|case)(?:[\\w:<>,&*]+ )+[&*]*(?:\\w+::)?(\\w+)\\("})
        declared_[file].merge(found(text, declaration));
    std::map<std::string, std::set<std::string>> headers;
    for (const auto& [file, text] : code_) {
      if (file.substr(file.size() - 2) != ".h") continue;
      for (const char* declaration :
           {"^[A-Za-z][A-Za-z0-9_:<>,&* \\[\\]]*[ &*]([a-z]\\w*)\\(",
            "^(?:class|struct|enum class) (?:DKB_SLAM_API )?(\\w+)(?![\\w;])", "^inline constexpr [\\w:]+ (k\\w+)"})
        for (const std::string& name : found(text, declaration))
          if (telling(name)) headers[name].insert(file);
    }
    for (const auto& [name, files] : headers)
      if (files.size() == 1) header_of_[name] = *files.begin();
  }

  // Names that a file uses without a way to the only header that declares them.
  std::vector<std::string> out_of_reach(const std::string& file) const {
    const std::string& code = code_.at(file);
    std::set<std::string> reached, used = found(code, "(?:^|[^\\w.>:~])(?:dkb::)?([a-zA-Z]\\w*)(?=\\()");
    reach(file, &reached);
    used.merge(found(code, "(?:^|[^\\w.>:~])(?:dkb::)?([A-Zk]\\w+)"));
    // Whatever else of that name it reaches, such as a member: a second one is not told from the first.
    std::set<std::string> own;
    for (const std::string& near : reached) own.insert(declared_.at(near).begin(), declared_.at(near).end());
    std::vector<std::string> missing;
    for (const std::string& name : used) {
      const auto header = header_of_.find(name);
      if (header != header_of_.end() && !own.count(name) && !reached.count(header->second))
        missing.push_back(name + " of " + header->second);
    }
    return missing;
  }
  size_t names() const { return header_of_.size(); }

 private:
  void reach(const std::string& file, std::set<std::string>* reached) const {
    if (!reached->insert(file).second) return;
    const auto includes = includes_.find(file);
    if (includes == includes_.end()) return;
    for (const std::string& next : includes->second) reach(next, reached);
  }

  std::map<std::string, std::string> code_;  // by file
  std::map<std::string, std::set<std::string>> includes_, declared_;
  std::map<std::string, std::string> header_of_;  // of each name that only one declares
};

TEST(IncludeReach, EachFileOfTheLibraryReachesTheHeadersOfWhatItUses) {
  std::map<std::string, std::string> code;
  for (const std::string folder : {"src/dkb", "include/dkb_slam"})
    for (const std::string& file : files_below(folder, {".cpp", ".h"})) code[file] = code_of(file);
  const SourceFiles files(code);
  EXPECT_GT(files.names(), 500u);
  for (const auto& [file, text] : code)
    for (const std::string& missing : files.out_of_reach(file))
      ADD_FAILURE() << file << " does not include " << missing;
}

TEST(IncludeReach, WhatAFileLacksIsFound) {
  const SourceFiles files(
      {{"src/dkb/a/far.h", "int far_away(int x);\nstruct FarThing {\n};\ninline constexpr int kFar = 3;\n"},
       {"src/dkb/a/near.h", "#include \"dkb/a/far.h\"\n"},
       {"src/dkb/a/lacks.cpp", "int f() {\n  return far_away(1) + kFar;\n}\nFarThing g();\n"},
       {"src/dkb/a/has.cpp", "#include \"dkb/a/near.h\"\nint f() { return far_away(1); }\n"},
       {"src/dkb/a/own.cpp", "int far_away(int x) {\n}\nint f() { return far_away(1); }\n"}});
  EXPECT_EQ(files.out_of_reach("src/dkb/a/lacks.cpp").size(), 3u);
  EXPECT_TRUE(files.out_of_reach("src/dkb/a/has.cpp").empty());
  EXPECT_TRUE(files.out_of_reach("src/dkb/a/own.cpp").empty());
}

}  // namespace
}  // namespace dkb::test
