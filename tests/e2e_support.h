// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dkb/util/test_folder.h"

namespace dkb::test {

struct Finished {
  int exit_code = -1;  // 1000 + signal when a signal ended it
  std::string out, err;
  size_t error_lines() const;
};

// dkb-slam, started with these arguments. With `max_file_size` [bytes] every write beyond fails, as on a full disk.
// `environment` holds NAME=VALUE to add to the test's own.
class Program {
 public:
  explicit Program(const std::vector<std::string>& arguments, long max_file_size = -1,
                   const std::vector<std::string>& environment = {});
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
Finished run_program(const std::vector<std::string>& arguments, long max_file_size = -1,
                     const std::vector<std::string>& environment = {});

// A simulated sequence of 40 frames at 640 x 480 in TUM layout, without people, the same for all tests. Made on demand.
constexpr int kSequenceFrames = 40;
std::filesystem::path sequence();

// `folder`, made by `simulate` with these arguments unless it is there already.
std::filesystem::path simulated(const std::filesystem::path& folder, const std::vector<std::string>& arguments);

// A file or folder of data that does not belong to the project, such as "models/yolov5n_320x256.onnx": in the folder
// that the environment variable DKB_DATA names, without it in ../shared/data beside the checkout. Empty when it is not
// there; the test then has nothing to do:
//   const std::filesystem::path model = outside_data(name);
//   if (model.empty()) GTEST_SKIP() << no_outside_data(name);
std::filesystem::path outside_data(const std::string& name);
std::string no_outside_data(const std::string& name);

// Its first `frames` pairs in a folder that may be changed: own lists and camera file, own copies of the images when
// `own_images`, else links to them.
void copy_sequence(const std::filesystem::path& folder, int frames, bool own_images);

void pause_ms(int ms);

// A sequence whose tenth image is a named pipe: a run cannot get past it.
class Endless {
 public:
  explicit Endless(const std::filesystem::path& folder);
  std::vector<std::string> run(const std::filesystem::path& out) const;
  // Whoever reads the pipe finds an empty file.
  void let_go() const;
  // Waits until the run reads the pipe, which it finds open and empty as long as the returned file is open.
  int hold_up(Program& program) const;

 private:
  std::filesystem::path folder_, pipe_;
};

// The exit code of a shell's line, in which `@` stands for the program.
int shell(std::string line);
// What such a line prints to standard error where that is a terminal.
std::string told_to_a_terminal(const std::string& line);

std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, const std::string& text);
// `run` on `dataset`, finished, with its results in `out`; without a detector unless `more` names one.
struct SlamRun {
  SlamRun(const std::filesystem::path& dataset, const std::filesystem::path& out_folder,
          const std::vector<std::string>& more = {}, const std::vector<std::string>& environment = {});
  std::filesystem::path out;
  Finished finished;
  nlohmann::json stats;  // of stats.json, where it is
};

// The rows of a list or trajectory without comments, split at white space.
std::vector<std::vector<std::string>> rows_of(const std::filesystem::path& file);

// [m] RMSE of the absolute error of `trajectory` against the ground truth of `dataset`.
double ape_of(const std::filesystem::path& dataset, const std::filesystem::path& trajectory);

}  // namespace dkb::test
