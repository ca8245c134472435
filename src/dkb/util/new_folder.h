// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

namespace dkb {

// A folder that is being filled: it is removed where nobody gets to keep() it, unless it was there before.
class NewFolder {
 public:
  explicit NewFolder(std::filesystem::path path) : path_(std::move(path)) {
    std::error_code error;
    kept_ = std::filesystem::exists(path_, error) || error;
  }
  ~NewFolder() {
    std::error_code ignored;
    if (!kept_) std::filesystem::remove_all(path_, ignored);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  void keep() { kept_ = true; }

 private:
  std::filesystem::path path_;
  bool kept_ = false;
};

// Folders that are made on the way: they go again where nothing came into them.
class NewFolders {
 public:
  NewFolders() = default;
  ~NewFolders() {
    std::error_code ignored;
    for (auto path = paths_.rbegin(); path != paths_.rend(); ++path)
      if (std::filesystem::is_directory(*path, ignored)) std::filesystem::remove(*path, ignored);
  }
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;
  // Before it is made, with those that it lies in.
  void note(const std::filesystem::path& path) {
    std::error_code ignored;
    for (std::filesystem::path at = path; !at.empty() && at != at.root_path() && !std::filesystem::exists(at, ignored);
         at = at.parent_path())
      paths_.insert(paths_.begin(), at);
  }
  void add(const std::filesystem::path& path) { paths_.push_back(path); }

 private:
  std::vector<std::filesystem::path> paths_;  // the outermost first
};

}  // namespace dkb
