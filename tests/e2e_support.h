// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace dkb::test {

// A folder of its own, removed at the end.
class TempFolder {
 public:
  TempFolder();
  ~TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

struct Finished {
  int exit_code = -1;  // 1000 + signal when a signal ended it
  std::string out, err;
  size_t error_lines() const;
};

// dkb-slam, started with these arguments. With `max_file_size` [bytes] every write beyond fails, as on a full disk.
class Program {
 public:
  explicit Program(const std::vector<std::string>& arguments, long max_file_size = -1);
  ~Program();
  pid_t pid() const { return pid_; }
  std::string err() const;  // what it has printed so far
  bool ended();             // never waits
  Finished wait();

 private:
  TempFolder folder_;
  pid_t pid_;
  bool ended_ = false;
  int status_ = 0;
};
Finished run_program(const std::vector<std::string>& arguments, long max_file_size = -1);

// A simulated sequence of 40 frames at 640 x 480 in TUM layout, without people, the same for all tests. Made on demand.
constexpr int kSequenceFrames = 40;
std::filesystem::path sequence();

// Its first `frames` pairs in a folder that may be changed: own lists and camera file, own copies of the images when
// `own_images`, else links to them.
void copy_sequence(const std::filesystem::path& folder, int frames, bool own_images);

std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, const std::string& text);
// `run` on `dataset` without a detector, finished, with its results in `out`.
struct SlamRun {
  SlamRun(const std::filesystem::path& dataset, const std::filesystem::path& out_folder,
          const std::vector<std::string>& more = {});
  std::filesystem::path out;
  Finished finished;
  nlohmann::json stats;  // of stats.json, where it is
};

// The rows of a list or trajectory without comments, split at white space.
std::vector<std::vector<std::string>> rows_of(const std::filesystem::path& file);

// [m] RMSE of the absolute error of `trajectory` against the ground truth of `dataset`.
double ape_of(const std::filesystem::path& dataset, const std::filesystem::path& trajectory);

}  // namespace dkb::test
