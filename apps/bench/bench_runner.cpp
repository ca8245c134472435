// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_runner.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <list>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>

#include "bench/bench_process.h"
#include "bench/fnv1a.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/geometry/camera.h"
#include "dkb/simulator/sequence_writer.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/timing.h"
#include "dkb_slam/version.h"
#include "terminal.h"

namespace dkb::bench {
namespace fs = std::filesystem;
namespace {

struct Interrupted {};

std::string host_prefix() {
  char host[256] = {};
  gethostname(host, sizeof host - 1);
  return std::string(host) + "-";
}

// Host and process: names what this bench has under way, on file systems that several machines share.
std::string own_name() {
  return host_prefix() + std::to_string(getpid());
}

// Runs that a killed bench left behind on this host.
void remove_stale_work(const fs::path& work) {
  const std::string prefix = host_prefix();
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(work, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    const long pid = std::atol(name.c_str() + prefix.size());
    if (pid > 0 && (pid == getpid() || (::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH)))
      fs::remove_all(entry.path(), error);
  }
}

// Removes a folder at the end, whatever happens.
class WorkFolder {
 public:
  explicit WorkFolder(const fs::path& all) : path_(all / own_name()) {
    remove_stale_work(all);
    make_output_folder(path_);
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
    fs::remove(path_.parent_path(), ignored);  // if no other bench works there
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// Whether the disk takes as much as a run may leave.
bool has_room(const fs::path& folder) {
  constexpr off_t kRoom = off_t{64} << 20;  // [bytes]
  const fs::path probe = folder / "room";
  const int fd = ::open(probe.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0644);
  const bool room = fd >= 0 && posix_fallocate(fd, 0, kRoom) == 0;
  if (fd >= 0) ::close(fd);
  std::error_code ignored;
  fs::remove(probe, ignored);
  return room;
}

// One line that renews itself on a terminal; a line per run elsewhere.
class Progress {
 public:
  Progress(size_t total, bool quiet) : total_(total), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}
  void say(const std::string& line) const {
    if (quiet_) return;
    tell(stderr, "{}{}\n", terminal_ ? "\r\033[K" : "", line);
    std::fflush(stderr);
  }
  void status(const std::string& line) const {
    if (quiet_ || !terminal_) return;
    tell(stderr, "\r\033[K{}", line);
    std::fflush(stderr);
  }
  void running(size_t done, size_t running) const {
    status(fmt::format("{}/{} runs done, {} running, ETA {}", done, total_, running, eta(done)));
  }
  void finished(size_t done, const RunRecord& r) const {
    const std::string what = !r.ok()
                                 ? "FAILED: " + r.failure
                                 : fmt::format("{}{:.1f}% tracked, {:.0f} s",
                                               r.ape ? fmt::format("APE {:.4f} m, ", r.ape->translation_m.rmse) : "",
                                               100 * r.tracked_share(), r.machine.wall_s);
    say(fmt::format("[{}/{}] {} {} seed {}: {}{}", done, total_, r.sequence, r.variant, r.seed, what,
                    terminal_ || done == total_ ? "" : ", ETA " + eta(done)));
  }
  void end() const {
    if (!quiet_ && terminal_) tell(stderr, "\r\033[K");
  }

 private:
  std::string eta(size_t done) const {
    if (done == 0) return "unknown";
    const auto s =
        static_cast<long>(watch_.ms() / 1000 * static_cast<double>(total_ - done) / static_cast<double>(done));
    return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60) : fmt::format("{}:{:02} h", s / 3600, s / 60 % 60);
  }
  size_t total_;
  bool quiet_, terminal_;
  Stopwatch watch_;
};

// A path of the suite on this machine: variables replaced, relative ones below `base`.
std::optional<fs::path> locate(const std::string& text, const fs::path& base, std::string* why) {
  std::string missing;
  const auto expanded = expand_environment(text, &missing);
  if (!expanded) {
    *why = "the environment variable " + missing + " is not set";
    return {};
  }
  return (base / *expanded).lexically_normal();  // an absolute one replaces the base
}

// The same of a file that must be there.
std::optional<fs::path> locate_file(const std::string& text, const fs::path& base, std::string* why) {
  auto path = locate(text, base, why);
  std::error_code ignored;
  if (!path || fs::exists(*path, ignored)) return path;
  *why = path->string() + " does not exist";
  return {};
}

// Draws the sequence unless it is there. Benches that start together draw it once: the others wait.
fs::path simulated_sequence(const ResultsFolder& folder, const SuiteSequence& s, int threads, const Progress& progress,
                            const std::atomic<bool>& stop) {
  const fs::path all = folder.path() / "sequences", path = all / s.name;
  make_output_folder(all);
  const int lock = ::open((all / ("." + s.name + ".lock")).c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  struct Closer {
    int fd;
    ~Closer() {
      if (fd >= 0) ::close(fd);
    }
  } closer{lock};
  while (lock >= 0 && flock(lock, LOCK_EX | LOCK_NB) != 0) {
    if (stop) throw Interrupted();
    if (errno != EWOULDBLOCK && errno != EINTR) break;  // a file system without locks: drawn twice, but whole
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  std::error_code ignored;
  if (fs::exists(path / "associations.txt", ignored)) return path;
  if (lock >= 0)  // nobody else draws it now: what others were killed over goes
    for (const auto& entry : fs::directory_iterator(all, ignored))
      if (entry.is_directory(ignored) && entry.path().filename().string().starts_with("." + s.name + "."))
        fs::remove_all(entry.path(), ignored);
  const fs::path mine = all / ("." + s.name + "." + own_name());
  const Simulator simulator(*s.simulated);
  progress.say(fmt::format("drawing {} ({} frames of scene {})", s.name, simulator.frames(), s.simulated->scene));
  SequenceWriterOptions options;
  options.threads = std::clamp(threads, 1, 64);
  try {
    write_sequence(
        simulator, mine,
        [&](int written) {
          progress.status(fmt::format("drawing {}: frame {}/{}", s.name, written, simulator.frames()));
          if (stop) throw Interrupted();
        },
        options);
  } catch (...) {
    fs::remove_all(mine, ignored);
    throw;
  }
  fs::rename(mine, path, ignored);
  if (!fs::exists(path / "associations.txt", ignored))
    throw OutputError(path.string() + ": this simulated sequence cannot be put in place");
  return path;
}

double stage_ms(const nlohmann::json& stats, const char* stage, const char* figure) {
  const auto& stages = stats.at("stages");
  return stages.contains(stage) ? stages.at(stage).at(figure).get<double>() : 0.0;
}

void read_stats(const fs::path& out, RunRecord* r) {
  const auto stats = nlohmann::json::parse(read_file(out / "stats.json"));
  r->frames = stats.at("frames");
  r->tracked = stats.at("tracked");
  r->lost = stats.at("lost");
  r->skipped = stats.at("skipped");
  r->keyframes = stats.at("keyframes");
  r->map_points = stats.at("map_points");
  r->maps = stats.at("maps");
  r->map_bytes = static_cast<int64_t>(fs::file_size(out / "map.dkb"));
  MachineFacts& m = r->machine;
  m.tracking_ms = stage_ms(stats, "tracking", "mean_ms");
  m.tracking_p95_ms = stage_ms(stats, "tracking", "p95_ms");
  m.local_ba_ms = stage_ms(stats, "local_ba", "mean_ms");
  m.keyframe_decision_ms = stage_ms(stats, "keyframe_decision", "mean_ms");
  m.wall_s = stats.at("wall_s");
  m.cpu_s = stats.at("cpu_s");
  m.peak_mb = stats.at("peak_rss_mb");
  const auto orb = nlohmann::json::parse(read_file(out / "cv_orb.json"));
  if (!orb.at("cv_orb_ms").is_null()) m.cv_orb_ms = orb.at("cv_orb_ms").get<double>();
}

void read_errors(const fs::path& out, const fs::path& truth_file, RunRecord* r) {
  std::error_code ignored;
  if (!fs::exists(truth_file, ignored)) return;
  const Trajectory truth = read_truth(truth_file);
  const Evaluation final = evaluate(truth, read_trajectory(out / "trajectory.txt"));
  r->ape = Scores{final.ape.translation, final.ape.rotation};
  r->rpe = Scores{final.rpe.translation, final.rpe.rotation};
  r->online_m = evaluate(truth, read_trajectory(out / "trajectory_online.txt")).ape.translation;
}

class Runner {
 public:
  Runner(const ResultsFolder& folder, const RunnerOptions& options, const std::atomic<bool>& stop)
      : folder_(folder),
        suite_(folder.suite()),
        options_(options),
        stop_(stop),
        program_(options.program.empty() ? fs::read_symlink("/proc/self/exe") : fs::absolute(options.program)) {
    if (::access(program_.c_str(), X_OK) != 0)
      throw InputError(program_.string() + ": is no program that can be run (--program)");
    program_id_ = program_id(program_);
  }

  RunnerReport run(const std::vector<Job>& jobs) {
    std::vector<Job> open;
    for (const Job& job : jobs) {
      const auto known = folder_.record(job);
      if (known && (known->ok() || !options_.retry))
        ++report_.reused;
      else
        open.push_back(job);
    }
    leave_out_missing(jobs, &open);
    ::unsetenv("DKB_SLAM_MODEL");  // a run's detector is what the suite says, whatever the machine's is
    const WorkFolder work(folder_.path() / "work");
    Progress progress(open.size(), options_.quiet);
    try {
      draw_simulated(open, progress);
      progress = Progress(open.size(), options_.quiet);
      run_all(open, work.path(), progress);
    } catch (const Interrupted&) {
      report_.interrupted = true;
    }
    progress.end();
    return report_;
  }

 private:
  struct Running {
    Job job;
    ChildProcess child;
    fs::path out;
    Stopwatch watch;
  };

  // Finds every folder and file that the open jobs need, and takes out the jobs whose are missing.
  void leave_out_missing(const std::vector<Job>& jobs, std::vector<Job>* open) {
    std::set<size_t> sequences, variants, no_sequence, no_variant;
    for (const Job& job : *open) sequences.insert(job.sequence), variants.insert(job.variant);
    std::string why;
    fs::path root = options_.suite_folder;
    std::string root_missing;
    if (!options_.data.empty())
      root = options_.data;
    else if (const auto found = locate(suite_.root, options_.suite_folder, &root_missing))
      root = *found;
    for (const size_t i : sequences) {
      const SuiteSequence& s = suite_.sequences[i];
      if (s.simulated) continue;
      why = root_missing.empty() || fs::path(s.path).is_absolute() ? "" : root_missing + " (or give --data FOLDER)";
      const auto path = why.empty() ? locate(s.path, root, &why) : std::nullopt;
      std::error_code ignored;
      if (path && (fs::exists(*path / "rgb.txt", ignored) || fs::exists(*path / "associations.txt", ignored))) {
        sequence_folder_[i] = *path;
        if (s.camera.empty() || builtin_camera(s.camera)) continue;
        if (const auto camera = locate_file(s.camera, root, &why)) {
          camera_[i] = *camera;
          continue;
        }
      } else if (path) {
        why = path->string() + " holds no sequence in TUM layout";
      }
      if (s.get.empty()) throw InputError("sequence " + s.name + ": " + why);
      report_.left_out.push_back({"sequence " + s.name, why, s.get});
      no_sequence.insert(i);
    }
    for (const size_t i : variants) {
      const SuiteVariant& v = suite_.variants[i];
      bool there = true;
      for (const auto& [file, found] : {std::pair{&v.model, &model_}, std::pair{&v.labels, &labels_}}) {
        if (!there || file->empty()) continue;
        const auto path = locate_file(*file, root, &why);
        there = path.has_value();
        if (there) (*found)[i] = *path;
      }
      if (there) continue;
      if (v.get.empty()) throw InputError("variant " + v.name + ": " + why);
      report_.left_out.push_back({"variant " + v.name, why, v.get});
      no_variant.insert(i);
    }
    std::erase_if(
        *open, [&](const Job& job) { return no_sequence.contains(job.sequence) || no_variant.contains(job.variant); });
    if (open->empty() && report_.reused == 0 && !jobs.empty())
      throw InputError(fmt::format("nothing of suite {} can run here: {}, {}", suite_.name, report_.left_out.at(0).what,
                                   report_.left_out.at(0).why));
  }

  void draw_simulated(const std::vector<Job>& jobs, const Progress& progress) {
    for (const Job& job : jobs)
      if (const SuiteSequence& s = suite_.sequences[job.sequence];
          s.simulated && !sequence_folder_.contains(job.sequence))
        sequence_folder_[job.sequence] = simulated_sequence(folder_, s, 2 * options_.parallel, progress, stop_);
  }

  std::vector<std::string> command(const Job& job, const fs::path& out) const {
    const SuiteSequence& s = suite_.sequences[job.sequence];
    const SuiteVariant& v = suite_.variants[job.variant];
    const fs::path& data = sequence_folder_.at(job.sequence);
    std::vector<std::string> words = {program_.string(),
                                      "run",
                                      data.string(),
                                      "--out",
                                      out.string(),
                                      "--quiet",
                                      "--cv-orb",
                                      "--preset",
                                      v.preset,
                                      "--seed",
                                      std::to_string(job.seed),
                                      "--skip-pairs",
                                      std::to_string(job.seed - 1)};
    const auto add = [&](const char* option, const std::string& value) {
      if (!value.empty()) words.insert(words.end(), {option, value});
    };
    const int64_t most = s.max_frames > 0 ? s.max_frames : suite_.max_frames;
    add("--max-frames", most > 0 ? std::to_string(most) : "");
    const auto camera = camera_.find(job.sequence);
    add("--camera", camera != camera_.end() ? camera->second.string() : s.camera);
    add("--disable", v.disabled());
    add("--detector", v.detector);
    add("--filter", v.filter);
    if (const auto model = model_.find(job.variant); model != model_.end()) add("--model", model->second.string());
    if (const auto labels = labels_.find(job.variant); labels != labels_.end())
      add("--labels", labels->second.string());
    add("--classes", v.classes);
    add("--inference", v.inference);
    if (!v.boxes.empty()) add("--boxes", (data / v.boxes).string());
    if (!v.masks.empty()) add("--masks", (data / v.masks).string());
    for (const auto& [key, value] : v.set) add("--set", key + "=" + value);
    return words;
  }

  Running start(const Job& job, const fs::path& work) {
    const fs::path out = work / fmt::format("{}", ++started_);
    make_output_folder(out);
    return {job, ChildProcess(command(job, out), out / "stderr"), out, {}};
  }

  RunRecord record_of(const Running& run, const Ended& how, const std::string& failure) const {
    RunRecord r;
    r.sequence = suite_.sequences[run.job.sequence].name;
    r.variant = suite_.variants[run.job.variant].name;
    r.seed = run.job.seed;
    r.machine.parallel_runs = options_.parallel;
    r.machine.cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    r.machine.program = program_id_;
    try {
      r.failure = failure;
      if (failure.empty() && how.exit_code != 0) r.failure = how.failure(read_file(run.out / "stderr"));
      std::error_code ignored;
      if (r.ok() && !fs::exists(run.out / "trajectory.txt", ignored)) r.failure = "it left no trajectory.txt";
      if (r.ok() || fs::exists(run.out / "stats.json", ignored)) read_stats(run.out, &r);
      if (r.ok())
        read_errors(run.out, sequence_folder_.at(run.job.sequence) / suite_.sequences[run.job.sequence].truth, &r);
    } catch (const std::exception& e) {
      if (r.failure.empty()) r.failure = fmt::format("its results cannot be read: {}", e.what());
    }
    return r;
  }

  // Keeps what a run left. Throws OutputError when the disk is full, of which a run's failure may be the first sign:
  // statistics are the last of its results.
  RunRecord finish(const Running& run, const Ended& how, const std::string& failure) const {
    const RunRecord r = record_of(run, how, failure);
    std::error_code ignored;
    if (how.exit_code == 1 && !fs::exists(run.out / "stats.json", ignored) && !has_room(run.out))
      throw OutputError(r.failure + "; finished runs are kept, start again to go on");
    const fs::path trajectory = run.out / "trajectory.txt";
    const fs::path truth = folder_.truth_path(run.job.sequence);
    if (r.ape && !fs::exists(truth, ignored)) {
      make_output_folder(truth.parent_path());
      write_file_atomically(
          truth, read_file(sequence_folder_.at(run.job.sequence) / suite_.sequences[run.job.sequence].truth));
    }
    folder_.save(run.job, r, r.ok() ? read_file(trajectory) : "");
    fs::remove_all(run.out, ignored);
    return r;
  }

  void run_all(const std::vector<Job>& jobs, const fs::path& work, const Progress& progress) {
    std::list<Running> running;
    size_t next = 0, done = 0;
    while (done < jobs.size()) {
      if (stop_) throw Interrupted();
      while (next < jobs.size() && running.size() < static_cast<size_t>(options_.parallel))
        running.push_back(start(jobs[next++], work));
      bool any = false;
      for (auto it = running.begin(); it != running.end();) {
        Ended how;
        std::string failure;
        if (!it->child.ended(&how)) {
          if (it->watch.ms() < 1000 * suite_.timeout) {
            ++it;
            continue;
          }
          it->child.kill();
          failure = fmt::format("hung: no end after {:g} s", suite_.timeout);
        }
        if (stop_) throw Interrupted();  // no result: it will be repeated
        const RunRecord r = finish(*it, how, failure);
        it = running.erase(it);
        any = true;
        ++report_.done;
        report_.failed += !r.ok();
        progress.finished(++done, r);
      }
      progress.running(done, running.size());
      if (!any) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  const ResultsFolder& folder_;
  const Suite& suite_;
  const RunnerOptions& options_;
  const std::atomic<bool>& stop_;
  fs::path program_;
  std::string program_id_;
  std::map<size_t, fs::path> sequence_folder_, camera_, model_, labels_;
  int started_ = 0;
  RunnerReport report_;
};

}  // namespace

void RunnerOptions::check() const {
  require_option(parallel >= 1 && parallel <= 1024, "jobs", parallel, "from 1 to 1024");
}

RunnerReport run_jobs(const ResultsFolder& folder, const std::vector<Job>& jobs, const RunnerOptions& options,
                      const std::atomic<bool>& stop) {
  options.check();
  return Runner(folder, options, stop).run(jobs);
}

std::string program_id(const fs::path& program) {
  uint64_t hash = kFnv1aStart;
  // In blocks, as a run's own memory is measured.
  std::ifstream file(program, std::ios::binary);
  std::vector<char> block(1 << 16);
  while (file.read(block.data(), static_cast<std::streamsize>(block.size())), file.gcount() > 0)
    hash = fnv1a({block.data(), static_cast<size_t>(file.gcount())}, hash);
  if (!file.eof()) throw InputError(program.string() + ": cannot be read");
  return fmt::format("{} {:016x}", DKB_SLAM_VERSION, hash);
}

}  // namespace dkb::bench
