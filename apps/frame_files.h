// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>

#include "dkb/util/files.h"
#include "dkb_slam/slam.h"

namespace dkb {

// The files that have rows of every frame: movers.csv, and those that were asked for of features.csv, detections.txt
// and debug.log. They grow in the folder as NAME.part, so that a long run takes no memory for them and one that is
// killed leaves what it had. A file that cannot be written is given up, and its error thrown.
class FrameFiles {
 public:
  struct Wanted {
    bool features = false, detections = false, log = false;
  };
  FrameFiles(const std::filesystem::path& folder, const Wanted& wanted);

  // `stamp`: the frame's as read.
  void add(const std::string& stamp, const FrameResult& result);
  // They are whole: each takes its name.
  void commit();
  std::set<std::string> names() const;  // of those that are written or were committed

 private:
  struct File {
    File(const std::filesystem::path& folder, std::string file_name, const std::string& header);
    std::string name;
    GrowingFile growing;
    bool lost = false;
  };
  static void write(std::optional<File>& file, const std::string& rows);

  std::optional<File> movers_, features_, detections_, log_;
};

// How files are called that a killed run had not finished.
constexpr const char* kUnfinished = ".part";

}  // namespace dkb
