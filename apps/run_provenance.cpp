// SPDX-License-Identifier: Apache-2.0
#include "run_provenance.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "bench/bench_runner.h"

namespace dkb {
namespace {

// The words of the command line as they were given, without the program.
std::vector<std::string> words_given() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(file, word, '\0');) words.push_back(word);
  if (!words.empty()) words.erase(words.begin());
  return words;
}

}  // namespace

std::string run_json(const RunArguments& args, const Options& options, const Camera& camera) {
  nlohmann::ordered_json j;
  j["program"] = bench::program_id("/proc/self/exe");
  j["arguments"] = words_given();
  j["source"] = args.source;
  j["camera"] = {{"width", camera.width},
                 {"height", camera.height},
                 {"fx", camera.fx},
                 {"fy", camera.fy},
                 {"cx", camera.cx},
                 {"cy", camera.cy},
                 {"depth_factor", camera.depth_factor}};
  j["preset"] = options.preset();
  j["seed"] = options.seed;
  const SourceOptions& r = args.reading;
  j["skip_pairs"] = r.skip_pairs;
  j["start"] = r.start;
  j["end"] = nullptr;
  if (std::isfinite(r.end)) j["end"] = r.end;
  j["max_frames"] = nullptr;
  if (r.max_frames) j["max_frames"] = *r.max_frames;
  return j.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace dkb
