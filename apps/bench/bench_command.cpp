// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <thread>

#include "bench/bench_report.h"
#include "bench/bench_results.h"
#include "bench/bench_runner.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "interrupt.h"
#include "number_check.h"
#include "terminal.h"

namespace dkb {
namespace fs = std::filesystem;
using namespace bench;
namespace {

struct BenchArguments {
  std::string suite, out, shard, merge;
  std::vector<std::string> sequences, variants;
  int seeds = 0;           // 0 = as the suite says
  int64_t max_frames = 0;  // likewise
  RunnerOptions runner;
  ReportOptions report;
  bool no_times = false;
};

// Whether `name` is among `chosen`, which must all exist; an empty choice is everything.
template <class Item>
std::vector<bool> chosen(const std::vector<std::string>& names, const std::vector<Item>& items, const char* what) {
  std::vector<bool> take(items.size(), names.empty());
  std::vector<std::string> known;
  for (const Item& item : items) known.push_back(item.name);
  for (const std::string& name : names) {
    const auto at = std::find(known.begin(), known.end(), name);
    if (at == known.end()) {
      const std::string near = did_you_mean(name, known);
      throw InputError(fmt::format("--{}: the suite has no {} \"{}\"{}", what, what, name,
                                   near.empty() ? "; it has " + listed(known) : near));
    }
    take[static_cast<size_t>(at - known.begin())] = true;
  }
  return take;
}

void say_report(const fs::path& folder) {
  tell(stdout, "{}: results.md, report.html, results.json, plots/\n", folder.string());
}

// `--merge DIR`: DIR may be a results folder, or hold several of them.
int merge(const BenchArguments& args) {
  const fs::path from = args.merge;
  std::vector<fs::path> parts;
  if (ResultsFolder::is_one(from)) parts.push_back(from);
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(from, error))
    if (entry.is_directory(error) && ResultsFolder::is_one(entry.path())) parts.push_back(entry.path());
  std::sort(parts.begin(), parts.end());
  if (parts.empty())
    throw InputError(args.merge + ": neither it nor a folder in it holds results of a bench (suite.json is missing)");
  const ResultsFolder first = ResultsFolder::read(parts.front());
  // Found out before anything is copied.
  for (const fs::path& part : parts)
    if (const ResultsFolder other = ResultsFolder::read(part); suite_hash(other.suite()) != suite_hash(first.suite()))
      throw InputError(part.string() + ": holds results of another suite than " + parts.front().string() + " (" +
                       other.suite().name + ", " + first.suite().name + "); merge one suite at a time");
  const fs::path into = args.out.empty() ? from : fs::path(args.out);
  if (into == from && parts.front() != from)
    throw InputError(args.merge + ": holds several results folders; name one for the whole with --out");
  for (const fs::path& part : parts) {
    const ResultsFolder from_part = ResultsFolder::read(part);
    SuiteText text = first.text();
    text.sequences = from_part.text().sequences;
    text.variants = from_part.text().variants;
    merge_into(ResultsFolder::open(into, text, first.suite()), from_part);
  }
  const ResultsFolder whole = ResultsFolder::read(into);
  size_t there = 0;
  const std::vector<Job> jobs = jobs_of(whole.suite());
  for (const Job& job : jobs) there += whole.record(job).has_value();
  write_report(into, make_report(whole, args.report));
  tell(stdout, "{} of {} runs\n", there, jobs.size());
  say_report(into);
  return 0;
}

int measure(const BenchArguments& args) {
  const Shard shard = args.shard.empty() ? Shard() : parse_shard(args.shard);
  SuiteText text = read_suite(args.suite);
  text.seeds = args.seeds;
  text.max_frames = args.max_frames;
  text.sequences = args.sequences;
  text.variants = args.variants;
  const Suite suite = parse_suite(text);
  const auto sequences = chosen(args.sequences, suite.sequences, "sequence");
  const auto variants = chosen(args.variants, suite.variants, "variant");
  std::vector<Job> jobs = jobs_of(suite, shard);
  std::erase_if(jobs, [&](const Job& job) { return !sequences[job.sequence] || !variants[job.variant]; });

  const fs::path out = args.out.empty() ? fs::path("dkb-out") / ("bench-" + suite.name) : fs::path(args.out);
  RunnerOptions options = args.runner;
  options.check();
  options.suite_folder = fs::absolute(fs::path(args.suite)).parent_path();
  const ResultsFolder folder = ResultsFolder::open(out, text, suite);
  std::atomic<bool> stopped{false};
  const Interrupt interrupt([&] { stopped = true; });
  const RunnerReport report = run_jobs(folder, jobs, options, stopped);
  for (const LeftOut& left : report.left_out)
    tell(stderr, "left out: {}: {}; to get it: {}\n", left.what, left.why, left.get);
  tell(stdout, "{} runs done, {} of them failed; {} were there already\n", report.done, report.failed, report.reused);
  if (report.interrupted) {
    tell(stderr, "interrupted: start the same command again to go on\n");
    return 130;
  }
  const auto failed = [&](const Job& job) {
    const auto record = folder.record(job);
    return !record || !record->ok();
  };
  const int exit_code = !jobs.empty() && std::all_of(jobs.begin(), jobs.end(), failed) ? 1 : 0;
  if (shard.count > 1) {
    tell(stdout, "shard {}/{} is complete; when all are: dkb-slam bench --merge {}\n", shard.index, shard.count,
         out.string());
    return exit_code;
  }
  write_report(out, make_report(folder, args.report));
  say_report(out);
  return exit_code;
}

int bench_main(BenchArguments& args) {
  args.report.times = !args.no_times;
  if (args.suite.empty() == args.merge.empty())
    throw InputError("bench: give either a suite (YAML) or --merge FOLDER; see dkb-slam bench --help");
  return args.merge.empty() ? measure(args) : merge(args);
}

}  // namespace

void register_bench(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<BenchArguments>();
  CLI::App* command =
      app.add_subcommand("bench", "Run a suite, sequences x variants x seeds, and report medians with intervals");
  args->runner.parallel = static_cast<int>(std::max(1u, std::thread::hardware_concurrency() / 2));
  command->add_option("SUITE", args->suite, "YAML file of the suite, e.g. bench/suites/simulated.yaml");
  command->add_option("--out", args->out,
                      "Folder of the results; a bench that stopped goes on there (dkb-out/bench-NAME)");
  command->add_option("--jobs", args->runner.parallel, "Runs at a time; each keeps two threads busy")
      ->transform(whole_number<int>())
      ->capture_default_str();
  command->add_option("--shard", args->shard, "I/N: only the I-th of N parts, without a report");
  CLI::Option* merging = command->add_option(
      "--merge", args->merge, "Report on this results folder, or on several in this folder (with --out)");
  command->add_option("--data", args->runner.data, "Folder of the sequences, instead of the suite's root");
  command->add_option("--sequence", args->sequences, "Only this sequence; may be repeated")->allow_extra_args(false);
  command->add_option("--variant", args->variants, "Only this variant; may be repeated")->allow_extra_args(false);
  command->add_option("--seeds", args->seeds, "Runs per sequence and variant, instead of the suite's")
      ->transform(whole_number(1, 1000));
  command->add_option("--max-frames", args->max_frames, "Pairs per run at most, instead of the suite's")
      ->transform(whole_number<int64_t>(1, 1000000000));
  command->add_option("--program", args->runner.program, "Another build of dkb-slam to run");
  command->add_flag("--retry", args->runner.retry, "Repeat runs that failed");
  command->add_flag("--no-times", args->no_times, "Leave times and memory out of the report, so that reports compare");
  command->add_flag("--quiet", args->runner.quiet, "No progress");
  for (const char* of_runs :
       {"--jobs", "--shard", "--data", "--sequence", "--variant", "--seeds", "--max-frames", "--program", "--retry"})
    merging->excludes(command->get_option(of_runs));
  command->callback([args, &exit_code] { exit_code = bench_main(*args); });
}

}  // namespace dkb
