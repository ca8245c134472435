// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "bench/fnv1a.h"
#include "dkb/dataset/detector_choice.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"
#include "dkb/util/yaml_reader.h"
#include "dkb_slam/options.h"
#include "run_session.h"

namespace dkb::bench {
namespace fs = std::filesystem;
namespace {

const Range kFrames{0, 1e7};  // 0: all
constexpr size_t kMaxSequences = 1000, kMaxVariants = 1000;

// Names become file names and columns of tables. `reader`: where the name stands.
void check_name(const std::string& name, const YamlReader& reader) {
  const auto fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string("._+=-").find(c) != std::string::npos;
  };
  if (name.empty() || name.size() > 80 || name[0] == '.' || name[0] == '-' ||
      !std::all_of(name.begin(), name.end(), fine))
    reader.fail("the name " + in_quotes(name) + " must be made of letters, digits and . _ + = -");
}

std::vector<std::string> words_of(const YamlReader& map, const std::string& key) {
  if (!map.has(key)) return {};
  const YamlReader value = map.at(key);
  if (!value.is_list()) return {value.text()};
  std::vector<std::string> words;
  for (const YamlReader& word : value.list()) words.push_back(word.text());
  return words;
}

SimulatorOptions read_simulation(const YamlReader& reader) {
  SimulatorOptions o;
  int64_t seed = 1;
  reader.check_keys({"scene", "frames", "people", "seed"});
  reader.read("scene", &o.scene, simulator_scenes());
  reader.read("frames", &o.frames, {0, 100000});
  reader.read("people", &o.people, {0, 30});
  reader.read("seed", &seed, {0, 1e9});
  o.seed = static_cast<uint64_t>(seed);
  return o;
}

SuiteSequence read_sequence(const std::string& name, const YamlReader& reader) {
  SuiteSequence s;
  s.name = name;
  check_name(name, reader);
  reader.check_keys({"path", "simulate", "camera", "truth", "get", "published", "max_frames"});
  if (reader.has("simulate")) s.simulated = read_simulation(reader.at("simulate"));
  for (const auto& [key, field] :
       {std::pair{"path", &s.path}, std::pair{"camera", &s.camera}, std::pair{"truth", &s.truth},
        std::pair{"get", &s.get}, std::pair{"published", &s.published}})
    reader.read(key, field);
  reader.read("max_frames", &s.max_frames, kFrames);
  if (s.simulated.has_value() == !s.path.empty()) reader.fail("needs either a path or `simulate`");
  return s;
}

// Everything that `run` would refuse before its first frame, found before the first run of all.
void check_options(const SuiteVariant& v, const YamlReader& reader) {
  try {
    Options options(v.preset);
    for (const auto& [key, value] : v.set) options.set(key, value, "set");
    if (!v.filter.empty()) options.set("dynamics.filter", v.filter, "filter");
    options.disable(v.disabled());
    options.check();
    DetectorChoice choice;
    if (!v.detector.empty()) choice.kinds = v.detector;
    if (!v.inference.empty()) choice.inference = v.inference;
    choice.model = v.model;
    choice.labels = v.labels;
    choice.classes = v.classes;
    choice.boxes = v.boxes;
    check_detector(choice, !v.model.empty());
    choice = choice_beside(options, v.disabled(), choice);
    check_kinds(choice, !choice.model.empty());
  } catch (const InputError& e) {
    reader.fail(e.what());
  }
}

SuiteVariant read_variant(const std::string& name, const YamlReader& reader) {
  SuiteVariant v;
  v.name = name;
  check_name(name, reader);
  if (reader.empty()) return v;
  const std::vector<std::pair<std::string, std::string*>> texts = {
      {"preset", &v.preset}, {"detector", &v.detector}, {"filter", &v.filter},       {"model", &v.model},
      {"labels", &v.labels}, {"classes", &v.classes},   {"inference", &v.inference}, {"boxes", &v.boxes},
      {"masks", &v.masks},   {"get", &v.get},           {"published", &v.published}};
  std::vector<std::string> keys = {"disable", "set"};
  for (const auto& [key, unused] : texts) keys.push_back(key);
  reader.check_keys(keys);
  for (const auto& [key, field] : texts) reader.read(key, field);
  v.disable = words_of(reader, "disable");
  if (reader.has("set"))
    for (const auto& [key, value] : reader.at("set").items()) v.set[key] = value.text();
  check_options(v, reader);
  return v;
}

void read_sweep(const YamlReader& reader, Suite* suite) {
  SuiteSweep sweep;
  SuiteVariant base;
  std::vector<std::string> written;
  reader.check_keys({"setting", "label", "values", "published_choice", "options"});
  reader.read("setting", &sweep.setting);
  reader.read("label", &sweep.label);
  if (reader.has("values"))
    for (const YamlReader& value : reader.at("values").list()) {
      sweep.values.push_back(value.number({-1e9, 1e9}));
      written.push_back(value.text());
    }
  if (reader.has("published_choice")) sweep.published_choice = reader.at("published_choice").number({-1e9, 1e9});
  if (reader.has("options")) base = read_variant("sweep", reader.at("options"));
  if (sweep.setting.empty() || sweep.values.size() < 2) reader.fail("needs a setting and at least two values");
  if (sweep.values.size() > 100) reader.fail("has more than 100 values");
  if (sweep.label.empty()) sweep.label = sweep.setting;
  for (size_t i = 0; i < sweep.values.size(); ++i) {
    SuiteVariant v = base;
    v.name = sweep.label + "=" + written[i];
    v.set[sweep.setting] = written[i];
    v.swept = sweep.values[i];
    check_name(v.name, reader);
    check_options(v, reader);
    suite->variants.push_back(std::move(v));
  }
  suite->sweep = std::move(sweep);
}

void check_references(const Suite& suite, const YamlReader& root) {
  std::vector<std::string> names;
  for (const SuiteVariant& v : suite.variants) {
    if (std::find(names.begin(), names.end(), v.name) != names.end())
      root.fail("variant " + in_quotes(v.name) + " is made twice");
    names.push_back(v.name);
  }
  const auto check = [&](const std::string& key, const std::string& name) {
    if (suite.variant(name) == nullptr)
      root.at(key).fail("there is no variant " + in_quotes(name) + did_you_mean(name, names));
  };
  if (!suite.reference.empty()) check("reference", suite.reference);
  for (const std::string& name : suite.plotted) check("plotted", name);
  if (suite.sequences.empty()) root.fail("has no sequences");
  if (suite.variants.empty()) root.fail("has no variants");
  if (suite.sequences.size() > kMaxSequences || suite.variants.size() > kMaxVariants)
    root.fail(fmt::format("has more than {} sequences or {} variants", kMaxSequences, kMaxVariants));
}

void read_numbers(const YamlReader& root, const std::string& key,
                  std::map<std::string, std::map<std::string, double>>* table) {
  if (!root.has(key)) return;
  for (const auto& [row, cells] : root.at(key).items())
    for (const auto& [column, value] : cells.items()) (*table)[row][column] = value.number({0, 1e9});
}

}  // namespace

std::string SuiteVariant::disabled() const {
  std::string words;
  for (const std::string& part : disable) words += (words.empty() ? "" : ",") + part;
  return words;
}

const SuiteSequence* Suite::sequence(const std::string& sequence_name) const {
  const auto it =
      std::find_if(sequences.begin(), sequences.end(), [&](const auto& s) { return s.name == sequence_name; });
  return it == sequences.end() ? nullptr : &*it;
}

const SuiteVariant* Suite::variant(const std::string& variant_name) const {
  const auto it = std::find_if(variants.begin(), variants.end(), [&](const auto& v) { return v.name == variant_name; });
  return it == variants.end() ? nullptr : &*it;
}

std::optional<double> Suite::published_ape(const SuiteSequence& s, const SuiteVariant& v) const {
  const bool swept = v.swept.has_value();
  const auto& table = swept ? published.sweep_m : published.ape_m;
  const auto row = table.find(s.published.empty() ? s.name : s.published);
  if (row == table.end()) return {};
  for (const auto& [key, value] : row->second) {
    double number = 0;
    if (swept ? parse_number(key, &number) && number == *v.swept : key == (v.published.empty() ? v.name : v.published))
      return value;
  }
  return {};
}

Suite parse_suite(const SuiteText& text) {
  Suite suite;
  const YamlReader root(text.text, text.file);
  root.check_keys({"name", "description", "root", "seeds", "max_frames", "timeout", "reference", "plotted", "published",
                   "sequences", "variants", "sweep"});
  suite.name = fs::path(text.file).stem().string();
  for (const auto& [key, field] :
       {std::pair{"name", &suite.name}, std::pair{"description", &suite.description}, std::pair{"root", &suite.root},
        std::pair{"reference", &suite.reference}, std::pair{"published", &suite.published_file}})
    root.read(key, field);
  check_name(suite.name, root.has("name") ? root.at("name") : root);
  root.read("seeds", &suite.seeds, {1, 1000});
  root.read("max_frames", &suite.max_frames, kFrames);
  root.read("timeout", &suite.timeout, {1, 1e6});
  suite.plotted = words_of(root, "plotted");
  if (root.has("sequences"))
    for (const auto& [name, value] : root.at("sequences").items())
      suite.sequences.push_back(read_sequence(name, value));
  if (root.has("variants"))
    for (const auto& [name, value] : root.at("variants").items()) suite.variants.push_back(read_variant(name, value));
  if (root.has("sweep")) read_sweep(root.at("sweep"), &suite);
  if (text.seeds > 0) suite.seeds = text.seeds;
  if (text.max_frames > 0) {
    suite.max_frames = text.max_frames;
    for (SuiteSequence& s : suite.sequences) s.max_frames = 0;
  }
  check_references(suite, root);
  if (!suite.published_file.empty()) suite.published = parse_published(text.published, suite.published_file);
  return suite;
}

SuiteText read_suite(const fs::path& file) {
  SuiteText text;
  text.file = file.string();
  text.text = read_file(file);
  std::string published;
  YamlReader(text.text, text.file).read("published", &published);
  if (!published.empty()) text.published = read_file(file.parent_path() / published);
  return text;
}

PublishedTable parse_published(const std::string& text, const std::string& name) {
  PublishedTable table;
  const YamlReader root(text, name);
  root.check_keys({"source", "ape_m", "sweep_m"});
  root.read("source", &table.source);
  read_numbers(root, "ape_m", &table.ape_m);
  read_numbers(root, "sweep_m", &table.sweep_m);
  return table;
}

std::string suite_hash(const Suite& suite) {
  nlohmann::json j;
  j["root"] = suite.root;
  j["seeds"] = suite.seeds;
  j["max_frames"] = suite.max_frames;
  for (const SuiteSequence& s : suite.sequences) {
    nlohmann::json row = {
        {"name", s.name}, {"path", s.path}, {"camera", s.camera}, {"truth", s.truth}, {"max", s.max_frames}};
    if (s.simulated)
      row["simulated"] = {s.simulated->scene, s.simulated->frames, s.simulated->people, s.simulated->seed};
    j["sequences"].push_back(row);
  }
  for (const SuiteVariant& v : suite.variants)
    j["variants"].push_back({{"name", v.name},
                             {"preset", v.preset},
                             {"disable", v.disable},
                             {"detector", v.detector},
                             {"filter", v.filter},
                             {"files", {v.model, v.labels, v.boxes, v.masks}},
                             {"classes", v.classes},
                             {"inference", v.inference},
                             {"set", v.set}});
  return fmt::format("{:016x}", fnv1a(j.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace)));
}

std::vector<Job> jobs_of(const Suite& suite) {
  std::vector<Job> jobs;
  for (size_t s = 0; s < suite.sequences.size(); ++s)
    for (size_t v = 0; v < suite.variants.size(); ++v)
      for (int seed = 1; seed <= suite.seeds; ++seed) jobs.push_back({s, v, seed});
  return jobs;
}

Shard parse_shard(const std::string& text) {
  const size_t slash = text.find('/');
  int64_t index = 0, count = 0;
  if (slash == std::string::npos || !parse_number(text.substr(0, slash), &index) ||
      !parse_number(text.substr(slash + 1), &count))
    throw InputError("--shard: " + in_quotes(text) + " is not of the form I/N, e.g. 2/8");
  if (count < 1 || count > 100000 || index < 1 || index > count)
    throw InputError("--shard: " + in_quotes(text) +
                     " is out of range; shards are numbered 1/N ... N/N, N at most 100000");
  return {static_cast<int>(index), static_cast<int>(count)};
}

std::vector<Job> jobs_of(const Suite& suite, const Shard& shard) {
  const std::vector<Job> all = jobs_of(suite);
  std::vector<Job> mine;
  for (size_t i = static_cast<size_t>(shard.index) - 1; i < all.size(); i += static_cast<size_t>(shard.count))
    mine.push_back(all[i]);
  return mine;
}

std::optional<std::string> expand_environment(const std::string& text, std::string* missing) {
  std::string out;
  for (size_t at = 0; at < text.size();) {
    const size_t end = text.compare(at, 2, "${") == 0 ? text.find('}', at) : std::string::npos;
    if (end == std::string::npos) {
      out += text[at++];
      continue;
    }
    const std::string name = text.substr(at + 2, end - at - 2);
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') {
      *missing = name;
      return {};
    }
    out += value;
    at = end + 1;
  }
  return out;
}

}  // namespace dkb::bench
