// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_cv_orb.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "bench/bench_cv_orb_module.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/module.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

using Measure = decltype(&dkb_cv_orb_1);

// Null when this build has none.
Measure load_module() {
  std::string reason;
  const Module module{"libdkb_cv_orb.so", DKB_MODULE_LIBDIR, {DKB_MODULE_INSTALL_DIR}};
  return reinterpret_cast<Measure>(module_symbol(module, "dkb_cv_orb_1", &reason));
}

}  // namespace

std::optional<double> measure_cv_orb(const std::vector<DatasetPair>& pairs, const CameraModel& camera) try {
  constexpr size_t kImages = 60;
  const Measure measure = load_module();
  if (measure == nullptr) return {};
  std::vector<DatasetPair> chosen;
  const size_t n = std::min(kImages, pairs.size());
  for (size_t i = 0; i < n; ++i) chosen.push_back(pairs[i * pairs.size() / n]);
  RgbdReaderOptions options;
  options.threaded = false;
  RgbdReader reader(chosen, camera, options);
  double sum = 0;
  int frames = 0;
  bool warm = false;
  while (const auto frame = reader.next()) {
    if (!frame->image) continue;
    const GreyImage& grey = frame->image->grey;
    if (!warm) measure(grey.data(), grey.width(), grey.height());  // first use sets up tables
    warm = true;
    const double ms = measure(grey.data(), grey.width(), grey.height());
    if (ms < 0) return {};
    sum += ms;
    ++frames;
  }
  return frames > 0 ? std::optional<double>(sum / frames) : std::nullopt;
} catch (const InputError&) {  // none of the chosen images can be read
  return {};
}

void write_cv_orb(const fs::path& folder, const std::optional<double>& ms) {
  nlohmann::ordered_json j;
  j["cv_orb_ms"] = ms ? nlohmann::ordered_json(*ms) : nlohmann::ordered_json();
  write_file_atomically(folder / "cv_orb.json", j.dump(2) + "\n");
}

}  // namespace dkb
