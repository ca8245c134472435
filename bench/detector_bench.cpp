// SPDX-License-Identifier: Apache-2.0
// How long a network takes, and how many people it finds of those that a sequence's boxes.txt and masks tell of.
//   detector_bench MODEL SEQUENCE [auto|onnxruntime|opencv]
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>

#include "dkb/dataset/image_codecs.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/detection/mask_folder.h"
#include "dkb/detection/onnx_detector.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/quantile.h"
#include "dkb/util/timing.h"
#include "dkb_slam/source.h"

namespace {
using namespace dkb;
namespace fs = std::filesystem;

constexpr float kLeastSide = 32;    // [px] people of whom less is in view are not asked for
constexpr float kSamePlace = 0.5f;  // intersection over union

bool holds(const std::vector<Detection>& boxes, float x, float y) {
  return std::any_of(boxes.begin(), boxes.end(), [&](const Detection& d) {
    return x >= d.box.x && x < d.box.x + d.box.w && y >= d.box.y && y < d.box.y + d.box.h;
  });
}

struct Counts {
  size_t frames = 0, people = 0, found = 0;  // of the people
  size_t boxes = 0, wrong = 0;               // boxes that no person is in
  size_t pixels = 0, covered = 0;            // of the people, and of these in boxes or masks
  size_t beside = 0;                         // pixels of boxes or masks that are not of people

  void add(const Detections& truth, const GreyImage& mask, const Detections& answer) {
    ++frames;
    std::vector<Box> asked;
    for (const Detection& d : truth.boxes)
      if (d.class_name == "person" && std::min(d.box.w, d.box.h) >= kLeastSide) asked.push_back(d.box);
    people += asked.size();
    boxes += answer.boxes.size();
    for (const Detection& d : answer.boxes) {
      const auto touches = [&](const Detection& t) { return intersection_over_union(d.box, t.box) > 0; };
      if (std::none_of(truth.boxes.begin(), truth.boxes.end(), touches)) ++wrong;
      // A box, the surest first, finds one person: the one that it fits best.
      const auto best = std::max_element(asked.begin(), asked.end(), [&](const Box& a, const Box& b) {
        return intersection_over_union(d.box, a) < intersection_over_union(d.box, b);
      });
      if (best == asked.end() || intersection_over_union(d.box, *best) < kSamePlace) continue;
      ++found;
      asked.erase(best);
    }
    for (int y = 0; y < mask.height(); ++y)
      for (int x = 0; x < mask.width(); ++x) {
        const bool is_covered = answer.mask.empty()
                                    ? holds(answer.boxes, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)
                                    : answer.mask(x, y) != 0;
        if (mask(x, y) != 0) ++pixels;
        if (is_covered) ++(mask(x, y) != 0 ? covered : beside);
      }
  }
};

double percent(size_t part, size_t whole) {
  return 100 * static_cast<double>(part) / static_cast<double>(std::max<size_t>(whole, 1));
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) {
    fmt::print(stderr, "usage: detector_bench MODEL SEQUENCE [auto|onnxruntime|opencv]\n");
    return 2;
  }
  const fs::path sequence = argv[2];
  const auto source = open_source(sequence.string());
  const Camera& camera = source->camera();
  OnnxOptions options;
  options.model = argv[1];
  options.classes = "person";
  if (argc > 3) options.inference = inference_named(argv[3]);
  OnnxDetector network(options, camera.width, camera.height);
  FileDetector truth(sequence / "boxes.txt", camera.width, camera.height);
  MaskFolder masks(sequence / "masks", read_mask, {}, camera.width, camera.height);
  std::vector<double> milliseconds, filling_ms;
  const Preprocessing& preprocessing = network.head().preprocessing;
  const Letterbox letterbox =
      Letterbox::place(preprocessing.fit, camera.width, camera.height, network.input_width(), network.input_height());
  std::vector<float> blob;
  Counts counts;
  for (SourceFrame next = source->next(); next.state != SourceState::ended; next = source->next()) {
    if (next.state != SourceState::frame) continue;
    const DetectorInput image = detector_input(next.frame);
    const Stopwatch watch;
    const Detections answer = network.detect(image);
    milliseconds.push_back(watch.ms());
    const Stopwatch filling;
    fill_blob(image, letterbox, preprocessing, &blob);
    filling_ms.push_back(filling.ms());
    counts.add(truth.detect(image), masks.detect(image).mask, answer);
  }
  fmt::print(
      "{}, {} x {}, {}: {} frames, {:.1f} ms each, {:.2f} to fill the input (medians); {:.1f}% of {} people found, "
      "{:.1f}% of {} boxes hold nobody; {:.1f}% of the people's pixels covered, and as many as {:.1f}% of them "
      "beside\n",
      network.head().name, network.input_width(), network.input_height(), to_string(network.inference()), counts.frames,
      quantile(milliseconds, 0.5), quantile(filling_ms, 0.5), percent(counts.found, counts.people), counts.people,
      percent(counts.wrong, counts.boxes), counts.boxes, percent(counts.covered, counts.pixels),
      percent(counts.beside, counts.pixels));
  return 0;
} catch (const std::exception& e) {
  fmt::print(stderr, "error: {}\n", e.what());
  return 1;
}
