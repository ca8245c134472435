// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dkb/simulator/simulator.h"

namespace dkb::bench {

// One sequence of a suite: a folder in TUM layout, or one that is simulated when it is needed.
struct SuiteSequence {
  std::string name;
  std::string path;                           // as written; may hold ${VARIABLE}s; relative to the suite's root
  std::optional<SimulatorOptions> simulated;  // instead of `path`
  std::string camera;                         // as for `run --camera`; empty: as `run` chooses
  std::string truth = "groundtruth.txt";      // below the sequence's folder
  std::string get;                            // how to get it; with it, a missing folder is named and left out
  std::string published;                      // its name in the table of published numbers; empty: its own name
  int64_t max_frames = 0;                     // [pairs] 0 = as the suite says
};

// One system of a suite: the options of `run`.
struct SuiteVariant {
  std::string name;
  std::string preset = "default";
  std::vector<std::string> disable;
  // Empty: as `run` chooses. model: may hold ${VARIABLE}s; boxes, masks: below the sequence's folder.
  std::string detector, filter, model, labels, classes, inference, boxes, masks;
  std::map<std::string, std::string> set;  // settings by key
  std::string get;        // how to get what it needs, e.g. a model; with it, what is missing is named and left out
  std::string published;  // its name in the table of published numbers; empty: its own name
  std::optional<double> swept;  // its value, if it was made by the suite's sweep

  std::string disabled() const;  // as for `run --disable`
};

// One setting taken through a list of values; each value becomes a variant.
struct SuiteSweep {
  std::string setting, label;
  std::vector<double> values;
  std::optional<double> published_choice;  // the value that the published study chose
};

// Numbers that others published, as facts with their source.
struct PublishedTable {
  std::string source;
  std::map<std::string, std::map<std::string, double>> ape_m;    // [m] rmse by sequence and system
  std::map<std::string, std::map<std::string, double>> sweep_m;  // [m] rmse by sequence and value of the sweep
};

struct Suite {
  std::string name, description;
  std::string root;                  // folder of the sequences; may hold ${VARIABLE}s; empty: the suite file's folder
  int seeds = 5;                     // runs per sequence and variant; seed s leaves out the first s - 1 pairs
  int64_t max_frames = 0;            // [pairs] per run, 0 = all
  double timeout = 3600;             // [s] after which a run counts as hung
  std::string reference;             // variant that the others are compared with; empty: none
  std::vector<std::string> plotted;  // variants in the plots; empty: all
  std::vector<SuiteSequence> sequences;
  std::vector<SuiteVariant> variants;
  std::optional<SuiteSweep> sweep;
  std::string published_file;  // relative to the suite file
  PublishedTable published;

  const SuiteSequence* sequence(const std::string& sequence_name) const;  // null if there is none
  const SuiteVariant* variant(const std::string& variant_name) const;
  std::optional<double> published_ape(const SuiteSequence& s, const SuiteVariant& v) const;
};

// What is kept in a results folder, so that shards are merged without the suite's files.
struct SuiteText {
  std::string file;        // for messages
  std::string text;        // of the suite
  std::string published;   // of the table that it names, empty if it names none
  int seeds = 0;           // 0 = as the suite says
  int64_t max_frames = 0;  // likewise
  // Those that were chosen, of all benches in one folder; none = all.
  std::vector<std::string> sequences = {}, variants = {};
};

// Throws InputError with file:line: not YAML; a key that is unknown (with the nearest one), repeated or of a wrong
// type; a variant with an unknown preset, setting, filter or detector or a value out of range; a reference to a variant
// that does not exist; no sequence or no variant.
Suite parse_suite(const SuiteText& text);
// Reads the files; paths of the table of published numbers are relative to the suite's.
SuiteText read_suite(const std::filesystem::path& file);
PublishedTable parse_published(const std::string& text, const std::string& name);

// 16 hexadecimal digits of the suite's definition. Comments and layout do not count, nor do titles and hints.
std::string suite_hash(const Suite& suite);

// One run: indices into the suite, and the seed.
struct Job {
  size_t sequence = 0, variant = 0;
  int seed = 1;
};
// All runs in the order sequences, variants, seeds.
std::vector<Job> jobs_of(const Suite& suite);

struct Shard {
  int index = 1, count = 1;
};
// "2/8"; throws InputError unless 1 <= I <= N <= 100000.
Shard parse_shard(const std::string& text);
// Every N-th run, from the I-th: the shards are about equally long.
std::vector<Job> jobs_of(const Suite& suite, const Shard& shard);

// `text` with every ${NAME} replaced by the environment's; nothing, and the name in `missing`, when one is not set.
std::optional<std::string> expand_environment(const std::string& text, std::string* missing);

}  // namespace dkb::bench
