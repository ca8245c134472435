// SPDX-License-Identifier: Apache-2.0
#include "e2e_support.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "dkb/evaluation/trajectory_error.h"
#include "dkb/util/test_data.h"

namespace dkb::test {
namespace fs = std::filesystem;

size_t Finished::error_lines() const {
  std::istringstream lines(err);
  size_t n = 0;
  for (std::string line; std::getline(lines, line);) n += !line.empty();
  return n;
}

Program::Program(const std::vector<std::string>& arguments, long max_file_size,
                 const std::vector<std::string>& environment) {
  std::vector<std::string> words = {DKB_SLAM_EXECUTABLE};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  std::vector<char*> envp;
  for (char** v = environ; *v != nullptr; ++v) envp.push_back(*v);
  // The first of a name counts.
  std::vector<std::string> added = environment;
  for (std::string& v : added) envp.insert(envp.begin(), v.data());
  envp.push_back(nullptr);
  const std::string out = folder_ / "out", err = folder_ / "err";
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("cannot fork");
  if (pid_ == 0) {
    const int out_fd = open(out.c_str(), O_CREAT | O_WRONLY, 0600),
              err_fd = open(err.c_str(), O_CREAT | O_WRONLY, 0600);
    dup2(out_fd, STDOUT_FILENO);
    dup2(err_fd, STDERR_FILENO);
    if (max_file_size >= 0) {
      const rlimit limit{static_cast<rlim_t>(max_file_size), static_cast<rlim_t>(max_file_size)};
      setrlimit(RLIMIT_FSIZE, &limit);
      std::signal(SIGXFSZ, SIG_IGN);
    }
    execve(argv[0], argv.data(), envp.data());
    _exit(127);
  }
}

Program::~Program() {
  if (ended()) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, &status_, 0);
}

std::string Program::err() const {
  return fs::exists(folder_ / "err") ? read_text(folder_ / "err") : "";
}

bool Program::ended() {
  if (!ended_) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
  return ended_;
}

Finished Program::wait() {
  if (!ended_) waitpid(pid_, &status_, 0);
  ended_ = true;
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : 1000 + WTERMSIG(status_), read_text(folder_ / "out"), err()};
}

Finished run_program(const std::vector<std::string>& arguments, long max_file_size,
                     const std::vector<std::string>& environment) {
  return Program(arguments, max_file_size, environment).wait();
}

fs::path sequence() {
  return simulated(DKB_TEST_SEQUENCE,
                   {"--scene", "room", "--people", "0", "--seed", "3", "--frames", std::to_string(kSequenceFrames)});
}

fs::path simulated(const fs::path& folder, const std::vector<std::string>& arguments) {
  if (fs::exists(folder / "associations.txt")) return folder;
  // Written beside and moved into place, so that programs that start at the same time do not meet.
  const fs::path mine = folder.string() + "." + std::to_string(getpid());
  std::vector<std::string> words = {"simulate", "--out", mine.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const Finished made = run_program(words);
  if (made.exit_code != 0) throw std::runtime_error("simulate failed: " + made.err);
  std::error_code taken;
  fs::rename(mine, folder, taken);
  if (taken) fs::remove_all(mine);
  return folder;
}

fs::path outside_data(const std::string& name) {
  const fs::path path = test_data() / name;
  return fs::exists(path) ? path : fs::path();
}

std::string no_outside_data(const std::string& name) {
  return "skipped: " + name + " is not at hand; name the folder that has it in DKB_DATA";
}

void copy_sequence(const fs::path& folder, int frames, bool own_images) {
  const fs::path from = sequence();
  fs::create_directories(folder);
  for (const char* list : {"rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt"}) {
    std::string text;
    int rows = 0;
    std::ifstream in(from / list);
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with('#') || rows++ < frames) text += line + "\n";
    }
    write_text(folder / list, text);
  }
  fs::copy_file(from / "camera.yaml", folder / "camera.yaml");
  if (!own_images) {
    fs::create_directory_symlink(from / "rgb", folder / "rgb");
    fs::create_directory_symlink(from / "depth", folder / "depth");
    return;
  }
  fs::create_directory(folder / "rgb");
  fs::create_directory(folder / "depth");
  for (const auto& row : rows_of(folder / "associations.txt"))
    for (const std::string& image : {row.at(1), row.at(3)}) fs::copy_file(from / image, folder / image);
}

std::string read_text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << text;
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

SlamRun::SlamRun(const fs::path& dataset, const fs::path& out_folder, const std::vector<std::string>& more,
                 const std::vector<std::string>& environment)
    : out(out_folder) {
  std::vector<std::string> arguments = {"run", dataset.string(), "--out", out.string(), "--quiet"};
  if (std::find(more.begin(), more.end(), "--detector") == more.end())
    arguments.insert(arguments.end(), {"--detector", "none"});
  arguments.insert(arguments.end(), more.begin(), more.end());
  finished = run_program(arguments, -1, environment);
  if (fs::exists(out / "stats.json")) stats = nlohmann::json::parse(read_text(out / "stats.json"));
}

void pause_ms(int ms) {
  std::this_thread::sleep_for(std::chrono::milliseconds(ms));
}

Endless::Endless(const std::filesystem::path& folder) : folder_(folder) {
  copy_sequence(folder, 20, true);
  pipe_ = folder / rows_of(folder / "associations.txt")[10][1];
  std::filesystem::remove(pipe_);
  if (mkfifo(pipe_.c_str(), 0600) != 0) throw std::runtime_error("no named pipes here");
}

std::vector<std::string> Endless::run(const std::filesystem::path& out) const {
  return {"run", folder_.string(), "--out", out.string(), "--detector", "none"};
}

void Endless::let_go() const {
  const int fd = open(pipe_.c_str(), O_WRONLY | O_NONBLOCK);
  if (fd >= 0) close(fd);
}

int Endless::hold_up(Program& program) const {
  int fd = -1;
  while (fd < 0 && !program.ended()) fd = open(pipe_.c_str(), O_WRONLY | O_NONBLOCK), pause_ms(5);
  return fd;
}

int shell(std::string line) {
  for (size_t at = 0; (at = line.find('@', at)) != std::string::npos;) line.replace(at, 1, DKB_SLAM_EXECUTABLE);
  const int status = std::system(("exec 2>/dev/null; " + line).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

std::string told_to_a_terminal(const std::string& line) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0) throw std::runtime_error("no terminals here");
  const std::string name = ptsname(terminal);
  const int held = open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  shell(line + " 2>" + name);
  // The kernel hands bytes over some time after they were written, and in parts. They keep their order, so that all
  // are here once a byte written after them is.
  constexpr char kEnd = '\x04';
  if (write(held, &kEnd, 1) != 1) throw std::runtime_error("a terminal cannot be written to");
  std::string told;
  while (told.empty() || told.back() != kEnd) {
    char part[4096];
    const ssize_t size = read(terminal, part, sizeof part);
    if (size <= 0) throw std::runtime_error("a terminal cannot be read");
    told.append(part, static_cast<size_t>(size));
  }
  told.pop_back();
  close(held);
  close(terminal);
  return told;
}

std::vector<std::vector<std::string>> rows_of(const fs::path& file) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream text(read_text(file));
  for (std::string line; std::getline(text, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    rows.emplace_back();
    for (std::string w; words >> w;) rows.back().push_back(w);
  }
  return rows;
}

double ape_of(const fs::path& dataset, const fs::path& trajectory) {
  return evaluate(read_trajectory(dataset / "groundtruth.txt"), read_trajectory(trajectory)).ape.translation.rmse;
}

}  // namespace dkb::test
