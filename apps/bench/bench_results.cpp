// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb::bench {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;
constexpr int kFormat = 1;

// Of nothing they are not known: null.
Json to_json(const ErrorStatistics& s) {
  if (s.count == 0) return nullptr;
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std},
          {"min", s.min},   {"max", s.max},   {"count", s.count}};
}
Json to_json(const std::optional<Scores>& s) {
  if (!s) return nullptr;
  return {{"translation_m", to_json(s->translation_m)}, {"rotation_deg", to_json(s->rotation_deg)}};
}
ErrorStatistics statistics_from(const Json& j) {
  if (j.is_null()) return {};
  return {j.at("rmse"), j.at("mean"), j.at("median"), j.at("std"), j.at("min"), j.at("max"), j.at("count")};
}

std::optional<Scores> scores_from(const Json& j) {
  if (j.is_null()) return {};
  return Scores{statistics_from(j.at("translation_m")), statistics_from(j.at("rotation_deg"))};
}

// Calls `read`; whatever the JSON lacks becomes one line that names the file.
template <class Read>
auto guarded(const std::string& name, const char* what, const Read& read) {
  try {
    return read();
  } catch (const nlohmann::json::exception&) {
    throw InputError(name + ": is not " + what + "; remove it, or choose another folder");
  }
}

// No choice is all.
std::vector<std::string> chosen_by_either(std::vector<std::string> a, const std::vector<std::string>& b) {
  if (a.empty() || b.empty()) return {};
  a.insert(a.end(), b.begin(), b.end());
  std::sort(a.begin(), a.end());
  a.erase(std::unique(a.begin(), a.end()), a.end());
  return a;
}

// Nothing there, or an empty folder. Another shard that starts at the same time may just be writing its suite.json.
bool is_free(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return true;
  if (!fs::is_directory(path, error)) return false;
  for (const auto& entry : fs::directory_iterator(path, error))
    if (!entry.path().filename().string().starts_with(".suite.json.tmp")) return ResultsFolder::is_one(path);
  return true;
}

void copy_atomically(const fs::path& from, const fs::path& to) {
  std::error_code ignored;
  if (!fs::exists(from, ignored)) return;
  make_output_folder(to.parent_path());
  write_file_atomically(to, read_file(from));
}

}  // namespace

std::string record_json(const RunRecord& r) {
  Json j;
  j["sequence"] = r.sequence;
  j["variant"] = r.variant;
  j["seed"] = r.seed;
  j["failure"] = r.failure;
  j["frames"] = r.frames;
  j["tracked"] = r.tracked;
  j["lost"] = r.lost;
  j["skipped"] = r.skipped;
  j["keyframes"] = r.keyframes;
  j["map_points"] = r.map_points;
  j["map_bytes"] = r.map_bytes;
  j["maps"] = r.maps;
  j["scored"] = r.ape ? r.ape->translation_m.count : 0;
  j["ape"] = to_json(r.ape);
  j["rpe"] = to_json(r.rpe);
  j["online_m"] = nullptr;
  if (r.online_m) j["online_m"] = to_json(*r.online_m);
  const MachineFacts& m = r.machine;
  j["machine"] = {{"cv_orb_ms", nullptr},
                  {"tracking_ms", m.tracking_ms},
                  {"tracking_p95_ms", m.tracking_p95_ms},
                  {"local_ba_ms", m.local_ba_ms},
                  {"keyframe_decision_ms", m.keyframe_decision_ms},
                  {"wall_s", m.wall_s},
                  {"cpu_s", m.cpu_s},
                  {"peak_mb", m.peak_mb},
                  {"parallel_runs", m.parallel_runs},
                  {"cores", m.cores},
                  {"program", m.program}};
  if (m.cv_orb_ms) j["machine"]["cv_orb_ms"] = *m.cv_orb_ms;
  return j.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

RunRecord parse_record(const std::string& text, const std::string& name) {
  return guarded(name, "the record of a run", [&] {
    const Json j = Json::parse(text);
    RunRecord r;
    r.sequence = j.at("sequence");
    r.variant = j.at("variant");
    r.seed = j.at("seed");
    r.failure = j.at("failure");
    r.frames = j.at("frames");
    r.tracked = j.at("tracked");
    r.lost = j.at("lost");
    r.skipped = j.at("skipped");
    r.keyframes = j.at("keyframes");
    r.map_points = j.at("map_points");
    r.map_bytes = j.at("map_bytes");
    r.maps = j.value("maps", int64_t{1});  // records of 0.2.0 lack it, and the relative error
    r.ape = scores_from(j.at("ape"));
    if (j.contains("rpe")) r.rpe = scores_from(j.at("rpe"));
    if (const Json& online = j.at("online_m"); !online.is_null()) r.online_m = statistics_from(online);
    const Json& m = j.at("machine");
    if (!m.at("cv_orb_ms").is_null()) r.machine.cv_orb_ms = m.at("cv_orb_ms").get<double>();
    r.machine.tracking_ms = m.at("tracking_ms");
    r.machine.tracking_p95_ms = m.at("tracking_p95_ms");
    r.machine.local_ba_ms = m.at("local_ba_ms");
    r.machine.keyframe_decision_ms = m.at("keyframe_decision_ms");
    r.machine.wall_s = m.at("wall_s");
    r.machine.cpu_s = m.at("cpu_s");
    r.machine.peak_mb = m.at("peak_mb");
    r.machine.parallel_runs = m.at("parallel_runs");
    r.machine.cores = m.at("cores");
    r.machine.program = m.at("program");
    return r;
  });
}

bool ResultsFolder::is_one(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path / "suite.json", ignored);
}

ResultsFolder ResultsFolder::read(const fs::path& path) {
  if (!is_one(path)) throw InputError(path.string() + ": holds no results of a bench (suite.json is missing)");
  const std::string name = (path / "suite.json").string();
  const SuiteText text = guarded(name, "what a bench writes", [&] {
    const Json j = Json::parse(read_file(name));
    if (j.at("format") != kFormat) throw InputError(name + ": was written by another version of dkb-slam");
    SuiteText read{j.at("file"), j.at("text"), j.at("published"), j.at("seeds"), j.at("max_frames")};
    if (j.contains("sequences")) j.at("sequences").get_to(read.sequences);
    if (j.contains("variants")) j.at("variants").get_to(read.variants);
    return read;
  });
  return {path, text, parse_suite(text)};
}

ResultsFolder ResultsFolder::open(const fs::path& path, SuiteText text, const Suite& suite) {
  if (is_one(path)) {
    const ResultsFolder there = read(path);
    text.sequences = chosen_by_either(text.sequences, there.text().sequences);
    text.variants = chosen_by_either(text.variants, there.text().variants);
    if (suite_hash(there.suite()) != suite_hash(suite))
      throw InputError(
          fmt::format("{}: holds results of another suite ({} {}, this is {} {}); choose another folder "
                      "with --out",
                      path.string(), there.suite().name, suite_hash(there.suite()), suite.name, suite_hash(suite)));
  } else {
    if (!is_free(path))
      throw InputError(path.string() + ": is not empty and holds no results of a bench; choose another with --out");
    make_output_folder(path);
  }
  Json j;
  j["format"] = kFormat;
  j["hash"] = suite_hash(suite);
  j["name"] = suite.name;
  j["file"] = fs::path(text.file).filename().string();
  j["text"] = text.text;
  j["published"] = text.published;
  j["seeds"] = text.seeds;
  j["max_frames"] = text.max_frames;
  j["sequences"] = text.sequences;
  j["variants"] = text.variants;
  write_file_atomically(path / "suite.json", j.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  return {path, text, suite};
}

fs::path ResultsFolder::record_path(const Job& job) const {
  return path_ / "runs" / suite_.sequences.at(job.sequence).name / suite_.variants.at(job.variant).name /
         fmt::format("seed-{}.json", job.seed);
}
fs::path ResultsFolder::trajectory_path(const Job& job) const {
  return record_path(job).replace_extension(".txt");
}
fs::path ResultsFolder::truth_path(size_t sequence) const {
  return path_ / "truth" / (suite_.sequences.at(sequence).name + ".txt");
}

std::optional<RunRecord> ResultsFolder::record(const Job& job) const {
  const fs::path path = record_path(job);
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return {};
  RunRecord r = parse_record(read_file(path), path.string());
  if (r.sequence != suite_.sequences[job.sequence].name || r.variant != suite_.variants[job.variant].name ||
      r.seed != job.seed)
    throw InputError(path.string() + ": is the record of another run; remove it");
  return r;
}

void ResultsFolder::save(const Job& job, const RunRecord& record, const std::string& trajectory) const {
  const fs::path path = record_path(job);
  make_output_folder(path.parent_path());
  if (!trajectory.empty()) write_file_atomically(trajectory_path(job), trajectory);
  write_file_atomically(path, record_json(record));
}

void merge_into(const ResultsFolder& to, const ResultsFolder& from) {
  if (suite_hash(to.suite()) != suite_hash(from.suite()))
    throw InputError(from.path().string() + ": holds results of another suite (" + from.suite().name + ", not " +
                     to.suite().name + "); merge one suite at a time");
  std::error_code ignored;
  if (fs::equivalent(to.path(), from.path(), ignored)) return;
  for (size_t s = 0; s < to.suite().sequences.size(); ++s)
    if (!fs::exists(to.truth_path(s), ignored)) copy_atomically(from.truth_path(s), to.truth_path(s));
  for (const Job& job : jobs_of(to.suite())) {
    const auto theirs = from.record(job), ours = to.record(job);
    if (!theirs || (ours && (ours->ok() || !theirs->ok()))) continue;  // a run that failed here may have finished there
    copy_atomically(from.trajectory_path(job), to.trajectory_path(job));
    copy_atomically(from.record_path(job), to.record_path(job));
  }
}

}  // namespace dkb::bench
