// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_detector.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>

#include "dkb/detection/onnx_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr int kStep = 32;            // [px] the largest stride: inputs are multiples of it
constexpr int kMaxInputSize = 4096;  // [px]
constexpr int kProbe = 96;           // [px] smallest input whose cell count is no usual number of channels
constexpr int kYoloxInput = 416, kOtherInput = 640;  // [px] usual sizes of open graphs
constexpr int kFloat = 1;                            // TensorProto.DataType

std::string_view trim(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const size_t first = text.find_first_not_of(kSpace);
  return first == std::string_view::npos ? std::string_view()
                                         : text.substr(first, text.find_last_not_of(kSpace) + 1 - first);
}

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (size_t end = 0; end != std::string_view::npos;) {
    end = text.find(separator);
    parts.emplace_back(trim(text.substr(0, end)));
    if (end != std::string_view::npos) text.remove_prefix(end + 1);
  }
  while (!parts.empty() && parts.back().empty()) parts.pop_back();
  return parts;
}

std::vector<std::string> read_labels(const std::filesystem::path& path) {
  if (path.empty()) return coco_labels();
  const std::string text = read_file(path);
  std::vector<std::string> labels =
      split(text.starts_with("\xEF\xBB\xBF") ? std::string_view(text).substr(3) : text, '\n');
  if (labels.empty()) throw InputError(path.string() + ": holds no labels; write one class name per line");
  if (const auto blank = std::find(labels.begin(), labels.end(), ""); blank != labels.end())
    throw InputError(path.string() + ":" + std::to_string(blank - labels.begin() + 1) +
                     ": a blank line among the labels; write one class name per line");
  return labels;
}

// Which classes of `labels` the setting names. A name that the model lacks is an error only where the user chose it.
std::vector<bool> movable_classes(const OnnxOptions& options, const std::vector<std::string>& labels) {
  std::vector<bool> movable(labels.size(), false);
  for (const std::string& name : split(options.classes, ',')) {
    const auto at = std::find(labels.begin(), labels.end(), name);
    if (at != labels.end())
      movable[static_cast<size_t>(at - labels.begin())] = true;
    else if (options.classes != kMovableClasses)
      throw InputError(options.model.string() + ": has no class \"" + name + "\"" + did_you_mean(name, labels) +
                       "; choose the classes that may move among its labels");
  }
  if (std::find(movable.begin(), movable.end(), true) == movable.end())
    throw InputError(options.model.string() + ": none of its classes is among those that may move (" +
                     options.classes.substr(0, 80) + "); name some of its labels");
  return movable;
}

std::string describe(const std::vector<OnnxNetwork::Output>& outputs) {
  std::string text;
  for (const OnnxNetwork::Output& output : outputs) {
    text += text.empty() ? "" : ", ";
    for (size_t i = 0; i < output.dims.size(); ++i) text += (i == 0 ? "" : " x ") + std::to_string(output.dims[i]);
  }
  return text.empty() ? "no float output" : "output " + text;
}

int round_up(int value) {
  return (value + kStep - 1) / kStep * kStep;
}

// The input of `size` on its longer side with the least padding for images of this shape.
std::pair<int, int> input_for(int size, int width, int height) {
  const auto shorter = [&](int longer_side, int shorter_side) {
    return std::clamp(round_up(static_cast<int>(static_cast<int64_t>(size) * shorter_side / longer_side)), kStep, size);
  };
  return width >= height ? std::pair(size, shorter(width, height)) : std::pair(shorter(height, width), size);
}

std::optional<HeadLayout> head_at(OnnxNetwork& network, int width, int height, std::string* outputs) {
  const std::vector<float> blob(3 * static_cast<size_t>(width) * static_cast<size_t>(height), 0.5f);
  const std::vector<OnnxNetwork::Output> found = network.forward(blob, width, height);
  *outputs = describe(found);
  for (const OnnxNetwork::Output& output : found)
    if (const auto head = recognise_head(output.dims, width, height)) return head;
  return std::nullopt;
}

// The usual size of a graph with open input. Graphs that cannot run small tell nothing.
int usual_size(OnnxNetwork& network) {
  try {
    std::string outputs;
    const auto head = head_at(network, kProbe, kProbe, &outputs);
    return head && head->kind == YoloHead::yolox ? kYoloxInput : kOtherInput;
  } catch (const InputError&) {
    return kOtherInput;
  }
}

// Width and height of the graph's input; 0 x 0 when it leaves them open.
std::pair<int, int> declared_input(const OnnxInput& input, const std::string& name) {
  if (input.element_type != kFloat)
    throw InputError(
        name + ": the graph's input is not of 32-bit floats; export it without half precision or quantised input");
  if (input.dims.size() != 4 || input.dims[0] > 1 || (input.dims[1] != 3 && input.dims[1] != -1))
    throw InputError(
        name + ": the graph's input is not one colour image (1 x 3 x height x width); export a detector for one image");
  if (input.dims[2] < 0 || input.dims[3] < 0) return {0, 0};
  if (input.dims[2] > kMaxInputSize || input.dims[3] > kMaxInputSize || input.dims[2] % kStep != 0 ||
      input.dims[3] % kStep != 0)
    throw InputError(name + ": the graph's input of " + std::to_string(input.dims[3]) + " x " +
                     std::to_string(input.dims[2]) + " px is no multiple of 32 up to 4096; export it for such a size");
  return {static_cast<int>(input.dims[3]), static_cast<int>(input.dims[2])};
}

}  // namespace

void OnnxOptions::check() const {
  require_option(input_size == 0 || (input_size >= kStep && input_size <= kMaxInputSize && input_size % kStep == 0),
                 "input_size", input_size, "0 or a multiple of 32 up to 4096");
  require_option(min_score > 0 && min_score < 1, "min_score", min_score, "within (0, 1)");
  require_option(max_overlap > 0 && max_overlap <= 1, "max_overlap", max_overlap, "within (0, 1]");
}

OnnxDetector::OnnxDetector(const OnnxOptions& options, int width, int height) : options_(options) {
  options_.check();
  require_option(width > 0, "width", width, "positive");
  require_option(height > 0, "height", height, "positive");
  const std::string name = options_.model.string();
  const std::string bytes = read_file(options_.model);
  const OnnxInput input = read_onnx_input(bytes, name);
  const auto declared = declared_input(input, name);
  labels_ = read_labels(options_.labels);
  network_ = open_network(options_.inference, bytes, input.name, name);
  model_bytes_ = bytes.size();
  if (options_.input_size != 0)
    std::tie(input_width_, input_height_) = input_for(options_.input_size, width, height);
  else if (declared.first != 0)
    std::tie(input_width_, input_height_) = declared;
  else
    std::tie(input_width_, input_height_) = input_for(usual_size(*network_), width, height);
  std::string outputs;
  const auto head = [&] {
    try {
      return head_at(*network_, input_width_, input_height_, &outputs);
    } catch (const InputError& e) {
      if (options_.input_size == 0) throw;
      throw InputError(std::string(e.what()) + "; or leave input_size at 0");
    }
  }();
  if (!head)
    throw InputError(name + ": has no known detection head (" + outputs + " at " + std::to_string(input_width_) +
                     " x " + std::to_string(input_height_) +
                     " px); use a raw YOLOv5, YOLOv8 or YOLOX export without NMS" +
                     (options_.input_size == 0 ? "" : ", or leave input_size at 0"));
  head_ = *head;
  if (static_cast<size_t>(head_.classes) != labels_.size()) {
    const std::string count = std::to_string(labels_.size());
    throw InputError((options_.labels.empty() ? name : options_.labels.string()) + ": " +
                     (options_.labels.empty() ? "the graph scores " + std::to_string(head_.classes) +
                                                    " classes, COCO has " + count + "; give a file with its labels"
                                              : count + " labels for the " + std::to_string(head_.classes) +
                                                    " classes of " + name + "; write one per class and line"));
  }
  movable_ = movable_classes(options_, labels_);
}

OnnxDetector::~OnnxDetector() = default;

int OnnxDetector::frames_per_detection(double frames_per_second) const {
  constexpr double kNanoBytes = 8e6;       // the nano models, on which the time per pixel was measured, lie below
  constexpr double kReserve = 1.15;        // p95 above the mean
  constexpr double kEveryFrame = 2.0 / 3;  // of a frame's time: tracking and mapping want the cores, too
  const double ms_per_pixel = inference() == Inference::onnxruntime ? 0.11e-3 : 0.45e-3;
  const double ms =
      ms_per_pixel * input_width_ * input_height_ * std::max(1.0, static_cast<double>(model_bytes_) / kNanoBytes);
  const double frames = kReserve * ms * frames_per_second / 1000;
  return frames <= kEveryFrame ? 1 : static_cast<int>(std::ceil(frames)) + 1;
}

Detections OnnxDetector::detect(const DetectorInput& image) {
  if (image.grey.empty()) throw InputError("the detector was given an empty image");
  const Letterbox letterbox =
      Letterbox::fit(head_.kind, image.grey.width, image.grey.height, input_width_, input_height_);
  fill_blob(image, letterbox, head_.kind, &blob_);
  Detections found;
  for (const OnnxNetwork::Output& output : network_->forward(blob_, input_width_, input_height_)) {
    if (recognise_head(output.dims, input_width_, input_height_) != head_) continue;
    for (const Prediction& p :
         suppress_overlaps(decode(head_, output.values, input_width_, input_height_, movable_, options_.min_score),
                           options_.max_overlap)) {
      const Box box = clip(letterbox.to_image(p.box), image.grey.width, image.grey.height);
      if (box.w > 0 && box.h > 0) found.boxes.push_back({labels_[static_cast<size_t>(p.class_id)], box, p.score});
    }
    break;
  }
  return found;
}

}  // namespace dkb
