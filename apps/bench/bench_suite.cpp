// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_suite.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "bench/fnv1a.h"
#include "dkb/dataset/detector_choice.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"
#include "dkb_slam/options.h"
#include "run_session.h"

namespace dkb::bench {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMaxBytes = size_t{1} << 20;
constexpr int64_t kMaxSeeds = 1000, kMaxFrames = 10'000'000;
constexpr size_t kMaxSequences = 1000, kMaxVariants = 1000;

std::string in_quotes(const std::string& text) {
  return "\"" + one_line(text.substr(0, 80)) + (text.size() > 80 ? "...\"" : "\"");
}

// A node with its place in the file, for messages.
class Reader {
 public:
  Reader(const YAML::Node& node, std::string file, std::string path)
      : node_(node), file_(std::move(file)), path_(std::move(path)) {}

  [[noreturn]] void fail(const std::string& what) const {
    const YAML::Mark mark = node_.Mark();
    throw InputError((mark.is_null() ? file_ : file_ + ":" + std::to_string(mark.line + 1)) + ": " +
                     (path_.empty() ? "" : path_ + ": ") + what);
  }

  // The map's values by key. `known` empty: any keys.
  std::vector<std::pair<std::string, Reader>> items(const std::vector<std::string>& known = {}) const {
    if (!node_.IsMap()) fail("expected lines of the form `key: value`");
    std::vector<std::pair<std::string, Reader>> result;
    std::set<std::string> seen;
    for (const auto& item : node_) {
      const Reader key_reader(item.first, file_, path_);
      if (!item.first.IsScalar()) key_reader.fail("a key must be a word");
      const std::string key = item.first.Scalar();
      if (!known.empty() && std::find(known.begin(), known.end(), key) == known.end())
        key_reader.fail("unknown key " + in_quotes(key) + did_you_mean(key, known));
      if (!seen.insert(key).second) key_reader.fail("key " + in_quotes(key) + " is given twice");
      const std::string path = one_line(path_.empty() ? key : path_ + "." + key);
      result.emplace_back(key, Reader(item.second, file_, path.substr(0, 160)));
    }
    return result;
  }

  std::vector<Reader> list() const {
    if (!node_.IsSequence()) fail("expected a list, e.g. [a, b]");
    std::vector<Reader> result;
    for (const auto& item : node_) result.emplace_back(item, file_, path_);
    return result;
  }

  bool empty() const { return node_.IsNull(); }
  bool is_list() const { return node_.IsSequence(); }
  std::string text() const {
    if (!node_.IsScalar()) fail("expected a text");
    return node_.Scalar();
  }
  int64_t whole(int64_t min, int64_t max) const {
    int64_t value = 0;
    if (!parse_number(node_.IsScalar() ? node_.Scalar() : "", &value) || value < min || value > max)
      fail(fmt::format("expected a whole number from {} to {}", min, max));
    return value;
  }
  double number(double min, double max) const {
    double value = 0;
    if (!parse_number(node_.IsScalar() ? node_.Scalar() : "", &value) || !(value >= min && value <= max))
      fail(fmt::format("expected a number from {:g} to {:g}", min, max));
    return value;
  }
  // Names become file names and columns of tables.
  void check_name(const std::string& name) const {
    const auto fine = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             std::string("._+=-").find(c) != std::string::npos;
    };
    if (name.empty() || name.size() > 80 || name[0] == '.' || name[0] == '-' ||
        !std::all_of(name.begin(), name.end(), fine))
      fail("the name " + in_quotes(name) + " must be made of letters, digits and . _ + = -");
  }

 private:
  YAML::Node node_;
  std::string file_, path_;
};

// Runs `read` on the text as YAML; faults of the text become InputErrors.
void with_yaml(const std::string& text, const std::string& name, const std::function<void(const Reader&)>& read) {
  if (text.size() > kMaxBytes) throw InputError(name + ": is too large for a suite");
  if (text.find('\0') != std::string::npos) throw InputError(name + ": is not a text file");
  try {
    read(Reader(YAML::Load(text), name, ""));
  } catch (const YAML::Exception& e) {
    throw InputError((e.mark.is_null() ? name : name + ":" + std::to_string(e.mark.line + 1)) +
                     ": is not valid YAML (" + one_line(e.msg).substr(0, 120) + ")");
  }
}

using Readers = std::vector<std::pair<std::string, std::function<void(const Reader&)>>>;

// Hands every value of the map to the function of its key.
void read_keys(const Reader& map, const Readers& readers) {
  std::vector<std::string> known;
  for (const auto& [key, unused] : readers) known.push_back(key);
  for (const auto& [key, value] : map.items(known))
    for (const auto& [name, read] : readers)
      if (name == key) read(value);
}

std::function<void(const Reader&)> to_text(std::string* field) {
  return [field](const Reader& r) { *field = r.text(); };
}
std::function<void(const Reader&)> to_whole(int64_t* field, int64_t min, int64_t max) {
  return [field, min, max](const Reader& r) { *field = r.whole(min, max); };
}

std::vector<std::string> words_of(const Reader& r) {
  std::vector<std::string> words;
  if (r.is_list())
    for (const Reader& item : r.list()) words.push_back(item.text());
  else
    words.push_back(r.text());
  return words;
}

SimulatorOptions read_simulation(const Reader& reader) {
  SimulatorOptions o;
  int64_t frames = 0, people = -1, seed = 1;
  read_keys(reader, {{"scene", to_text(&o.scene)},
                     {"frames", to_whole(&frames, 0, 100000)},
                     {"people", to_whole(&people, 0, 30)},
                     {"seed", to_whole(&seed, 0, 1'000'000'000)}});
  o.frames = static_cast<int>(frames);
  o.people = static_cast<int>(people);
  o.seed = static_cast<uint64_t>(seed);
  const auto& scenes = simulator_scenes();
  if (std::find(scenes.begin(), scenes.end(), o.scene) == scenes.end())
    reader.fail("there is no scene " + in_quotes(o.scene) + did_you_mean(o.scene, scenes));
  return o;
}

SuiteSequence read_sequence(const std::string& name, const Reader& reader) {
  SuiteSequence s;
  s.name = name;
  reader.check_name(name);
  read_keys(reader, {{"path", to_text(&s.path)},
                     {"simulate", [&](const Reader& r) { s.simulated = read_simulation(r); }},
                     {"camera", to_text(&s.camera)},
                     {"truth", to_text(&s.truth)},
                     {"get", to_text(&s.get)},
                     {"published", to_text(&s.published)},
                     {"max_frames", to_whole(&s.max_frames, 0, kMaxFrames)}});
  if (s.simulated.has_value() == !s.path.empty()) reader.fail("needs either a path or `simulate`");
  return s;
}

// Everything that `run` would refuse before its first frame, found before the first run of all.
void check_options(const SuiteVariant& v, const Reader& reader) {
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

SuiteVariant read_variant(const std::string& name, const Reader& reader) {
  SuiteVariant v;
  v.name = name;
  reader.check_name(name);
  if (reader.empty()) return v;
  read_keys(reader, {{"preset", to_text(&v.preset)},
                     {"disable", [&](const Reader& r) { v.disable = words_of(r); }},
                     {"detector", to_text(&v.detector)},
                     {"filter", to_text(&v.filter)},
                     {"model", to_text(&v.model)},
                     {"labels", to_text(&v.labels)},
                     {"classes", to_text(&v.classes)},
                     {"inference", to_text(&v.inference)},
                     {"boxes", to_text(&v.boxes)},
                     {"masks", to_text(&v.masks)},
                     {"set",
                      [&](const Reader& r) {
                        for (const auto& [key, value] : r.items()) v.set[key] = value.text();
                      }},
                     {"get", to_text(&v.get)},
                     {"published", to_text(&v.published)}});
  check_options(v, reader);
  return v;
}

void read_sweep(const Reader& reader, Suite* suite) {
  SuiteSweep sweep;
  SuiteVariant base;
  base.name = "sweep";
  std::vector<std::string> written;
  read_keys(reader, {{"setting", to_text(&sweep.setting)},
                     {"label", to_text(&sweep.label)},
                     {"values",
                      [&](const Reader& r) {
                        for (const Reader& item : r.list()) {
                          sweep.values.push_back(item.number(-1e9, 1e9));
                          written.push_back(item.text());
                        }
                      }},
                     {"published_choice", [&](const Reader& r) { sweep.published_choice = r.number(-1e9, 1e9); }},
                     {"options", [&](const Reader& r) { base = read_variant("sweep", r); }}});
  if (sweep.setting.empty() || sweep.values.size() < 2) reader.fail("needs a setting and at least two values");
  if (sweep.values.size() > 100) reader.fail("has more than 100 values");
  if (sweep.label.empty()) sweep.label = sweep.setting;
  for (size_t i = 0; i < sweep.values.size(); ++i) {
    SuiteVariant v = base;
    v.name = sweep.label + "=" + written[i];
    v.set[sweep.setting] = written[i];
    v.swept = sweep.values[i];
    reader.check_name(v.name);
    check_options(v, reader);
    suite->variants.push_back(std::move(v));
  }
  suite->sweep = std::move(sweep);
}

void check_references(const Suite& suite, const Reader& root) {
  std::vector<std::string> names;
  for (const SuiteVariant& v : suite.variants) {
    if (std::find(names.begin(), names.end(), v.name) != names.end())
      root.fail("variant " + in_quotes(v.name) + " is made twice");
    names.push_back(v.name);
  }
  const auto check = [&](const std::string& key, const std::string& name) {
    if (suite.variant(name) == nullptr)
      root.fail(key + ": there is no variant " + in_quotes(name) + did_you_mean(name, names));
  };
  if (!suite.reference.empty()) check("reference", suite.reference);
  for (const std::string& name : suite.plotted) check("plotted", name);
  if (suite.sequences.empty()) root.fail("has no sequences");
  if (suite.variants.empty()) root.fail("has no variants");
  if (suite.sequences.size() > kMaxSequences || suite.variants.size() > kMaxVariants)
    root.fail(fmt::format("has more than {} sequences or {} variants", kMaxSequences, kMaxVariants));
}

std::map<std::string, std::map<std::string, double>> read_numbers(const Reader& reader) {
  std::map<std::string, std::map<std::string, double>> table;
  for (const auto& [row, cells] : reader.items())
    for (const auto& [column, value] : cells.items()) table[row][column] = value.number(0, 1e9);
  return table;
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
  with_yaml(text.text, text.file, [&](const Reader& root) {
    int64_t seeds = suite.seeds;
    Readers readers = {
        {"name",
         [&](const Reader& r) {
           suite.name = r.text();
           r.check_name(suite.name);
         }},
        {"description", to_text(&suite.description)},
        {"root", to_text(&suite.root)},
        {"seeds", to_whole(&seeds, 1, kMaxSeeds)},
        {"max_frames", to_whole(&suite.max_frames, 0, kMaxFrames)},
        {"timeout", [&](const Reader& r) { suite.timeout = r.number(1, 1e6); }},
        {"reference", to_text(&suite.reference)},
        {"plotted", [&](const Reader& r) { suite.plotted = words_of(r); }},
        {"published", to_text(&suite.published_file)},
        {"sequences",
         [&](const Reader& r) {
           for (const auto& [name, value] : r.items()) suite.sequences.push_back(read_sequence(name, value));
         }},
        {"variants",
         [&](const Reader& r) {
           for (const auto& [name, value] : r.items()) suite.variants.push_back(read_variant(name, value));
         }},
        {"sweep", [&](const Reader& r) { read_sweep(r, &suite); }},
    };
    read_keys(root, readers);
    suite.seeds = static_cast<int>(text.seeds > 0 ? text.seeds : seeds);
    if (text.max_frames > 0) {
      suite.max_frames = text.max_frames;
      for (SuiteSequence& s : suite.sequences) s.max_frames = 0;
    }
    if (suite.name.empty()) {
      suite.name = fs::path(text.file).stem().string();
      root.check_name(suite.name);
    }
    check_references(suite, root);
  });
  if (!suite.published_file.empty()) suite.published = parse_published(text.published, suite.published_file);
  return suite;
}

SuiteText read_suite(const fs::path& file) {
  SuiteText text;
  text.file = file.string();
  text.text = read_file(file);
  std::string published;
  with_yaml(text.text, text.file, [&](const Reader& root) {
    for (const auto& [key, value] : root.items())
      if (key == "published") published = value.text();
  });
  if (!published.empty()) text.published = read_file(file.parent_path() / published);
  return text;
}

PublishedTable parse_published(const std::string& text, const std::string& name) {
  PublishedTable table;
  with_yaml(text, name, [&](const Reader& root) {
    read_keys(root, {{"source", to_text(&table.source)},
                     {"ape_m", [&](const Reader& r) { table.ape_m = read_numbers(r); }},
                     {"sweep_m", [&](const Reader& r) { table.sweep_m = read_numbers(r); }}});
  });
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
