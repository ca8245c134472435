// SPDX-License-Identifier: Apache-2.0
// Stands in for libFuzzer: runs a fuzz target on files, and on changed copies of them.
//
//   PROGRAM [--seed N] [--count N] FILE...      count: changed copies, of all files in turn (default 0)
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/files.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

void run_on(const std::string& bytes) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
}

}  // namespace

int main(int argc, char** argv) try {
  uint64_t seed = 1, count = 0;
  std::vector<std::string> samples;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--seed" && i + 1 < argc)
      seed = std::stoull(argv[++i]);
    else if (word == "--count" && i + 1 < argc)
      count = std::stoull(argv[++i]);
    else
      samples.push_back(dkb::read_file(word));
  }
  if (samples.empty()) {
    std::fprintf(stderr, "error: give sample files, and --seed N --count N for changed copies of them\n");
    return 2;
  }
  for (const std::string& sample : samples) run_on(sample);
  for (uint64_t i = 0; i < count; ++i) {
    dkb::Random random(seed + i);  // input i alone: --seed (seed + i) --count 1, for the first sample
    run_on(dkb::mutated(samples[i % samples.size()], random));
  }
  std::printf("%zu samples and %llu changed copies: nothing found\n", samples.size(),
              static_cast<unsigned long long>(count));
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "error: %s\n", e.what());
  return 1;
}
