// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_cv_orb.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "bench/bench_cv_orb_module.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/module.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

using Measure = decltype(&dkb_cv_orb_1);

// Throws with the reason when this build has none.
Measure load_module() {
  std::string reason;
  const Module module{"libdkb_cv_orb.so", DKB_MODULE_LIBDIR, {DKB_MODULE_INSTALL_DIR}};
  void* symbol = module_symbol(module, "dkb_cv_orb_1", &reason);
  if (symbol == nullptr) throw std::runtime_error("this build has no libdkb_cv_orb.so (" + reason + ")");
  return reinterpret_cast<Measure>(symbol);
}

constexpr size_t kImages = 60;

class CvOrb {
 public:
  void add(const GreyImage& grey) {
    if (frames_ == 0) measure_(grey.data(), grey.width(), grey.height());  // first use sets up tables
    const double ms = measure_(grey.data(), grey.width(), grey.height());
    failed_ = failed_ || ms < 0;
    sum_ += ms;
    ++frames_;
  }
  std::optional<double> mean_ms() const {
    return frames_ > 0 && !failed_ ? std::optional<double>(sum_ / frames_) : std::nullopt;
  }

 private:
  const Measure measure_ = load_module();
  double sum_ = 0;
  int frames_ = 0;
  bool failed_ = false;
};

}  // namespace

std::optional<double> measure_cv_orb(const std::vector<DatasetPair>& pairs, const CameraModel& camera) try {
  std::vector<DatasetPair> chosen;
  const size_t n = std::min(kImages, pairs.size());
  for (size_t i = 0; i < n; ++i) chosen.push_back(pairs[i * pairs.size() / n]);
  RgbdReader reader(chosen, camera, {.threaded = false});
  CvOrb cv_orb;
  while (const auto frame = reader.next())
    if (frame->image) cv_orb.add(frame->image->grey);
  return cv_orb.mean_ms();
} catch (const InputError&) {  // none of the chosen images can be read
  return {};
}

std::optional<double> measure_cv_orb(Source& source, size_t pairs) {
  const size_t n = std::min(kImages, pairs);
  CvOrb cv_orb;
  for (size_t i = 0; i < n;) {
    const SourceFrame next = source.next();
    if (next.state == SourceState::ended) break;
    if (next.index < i * pairs / n) continue;
    ++i;
    if (next.state == SourceState::frame) cv_orb.add(next.frame.image()->grey);
  }
  return cv_orb.mean_ms();
}

void write_cv_orb(const fs::path& folder, const std::optional<double>& ms) {
  nlohmann::ordered_json j;
  j["cv_orb_ms"] = ms ? nlohmann::ordered_json(*ms) : nlohmann::ordered_json();
  write_file_atomically(folder / "cv_orb.json", j.dump(2) + "\n");
}

}  // namespace dkb
