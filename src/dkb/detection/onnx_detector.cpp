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
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr int kStep = 32;             // [px] sizes are chosen in steps of the largest stride of YOLO heads
constexpr int kMaxInputSize = 4096;   // [px] 200 MB of floats
constexpr float kMaxOverlap = 0.45f;  // intersection over union: the weaker of two boxes of a class is dropped above
// [px] Inputs that open graphs are tried at. 96, since a smaller one has as many cells as a head may have channels: 84
// at 64 px, where YOLOv8 has 4 + 80. 640, since transformers often keep to the size they were trained for.
constexpr int kProbes[] = {96, 640};

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
                       "; choose the classes that may move (--classes) among its labels");
  }
  if (std::find(movable.begin(), movable.end(), true) == movable.end())
    throw InputError(options.model.string() + ": none of its classes is among those that may move (" +
                     options.classes.substr(0, 80) + "); name those that may, by comma: --classes");
  return movable;
}

std::string describe(NetworkOutputs outputs) {
  std::string text;
  for (const OnnxNetwork::Output& output : outputs) {
    text += (text.empty() ? "" : ", ") + excerpt(output.name) + (output.name.empty() ? "" : " ");
    for (size_t i = 0; i < output.dims.size(); ++i) text += (i == 0 ? "" : " x ") + std::to_string(output.dims[i]);
  }
  return text.empty() ? "no output of numbers" : "output " + text;
}

std::string known_heads() {
  std::string text;
  for (const DetectorHead& head : detector_heads())
    text += (text.empty() ? "" : "; ") + std::string(head.name) + " (" + head.outputs + ")";
  return text;
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

// What it puts out for an image of one grey.
std::vector<OnnxNetwork::Output> try_out(OnnxNetwork& network, int width, int height) {
  const std::vector<float> blob(3 * static_cast<size_t>(width) * static_cast<size_t>(height), 0.5f);
  return network.forward(blob, width, height);
}

// The input of a graph that leaves its size open, for images of this shape.
std::pair<int, int> usual_input(OnnxNetwork& network, int width, int height) {
  for (const int size : kProbes) try {
      if (const auto layout = recognise_head(try_out(network, size, size), size, size)) {
        const DetectorHead& head = *layout->head;
        return head.transformer ? std::pair(head.usual_input, head.usual_input)
                                : input_for(head.usual_input, width, height);
      }
    } catch (const InputError&) {  // it does not run at this size
    }
  return input_for(kProbes[1], width, height);
}

// Width and height of the graph's input; 0 x 0 when it leaves them open.
std::pair<int, int> declared_input(const OnnxInput& input, const std::string& name) {
  if (input.element_type != kOnnxFloat)
    throw InputError(
        name + ": the graph's input is not of 32-bit floats; export it without half precision or quantised input");
  if (input.dims.size() != 4 || input.dims[0] > 1 || (input.dims[1] != 3 && input.dims[1] != -1))
    throw InputError(
        name + ": the graph's input is not one colour image (1 x 3 x height x width); export a detector for one image");
  if (input.dims[2] < 0 || input.dims[3] < 0) return {0, 0};
  if (input.dims[2] > kMaxInputSize || input.dims[3] > kMaxInputSize)
    throw InputError(name + ": the graph's input of " + std::to_string(input.dims[3]) + " x " +
                     std::to_string(input.dims[2]) + " px is beyond 4096; export it for a smaller size");
  return {static_cast<int>(input.dims[3]), static_cast<int>(input.dims[2])};
}

}  // namespace

OnnxDetector::OnnxDetector(const OnnxOptions& options, int width, int height) : options_(options) {
  require_option(width > 0, "width", width, "positive");
  require_option(height > 0, "height", height, "positive");
  const std::string name = options_.model.string();
  const std::string bytes = read_file(options_.model);
  const OnnxInput input = read_onnx_input(bytes, name);
  std::tie(input_width_, input_height_) = declared_input(input, name);
  if (!options_.labels.empty()) labels_ = read_labels(options_.labels);
  network_ = open_network(options_.inference, bytes, input, name);
  model_bytes_ = bytes.size();
  if (input_width_ == 0) std::tie(input_width_, input_height_) = usual_input(*network_, width, height);
  const auto outputs = try_out(*network_, input_width_, input_height_);
  const auto layout = recognise_head(outputs, input_width_, input_height_);
  const bool whole = input_width_ % kStep == 0 && input_height_ % kStep == 0;
  if (!layout)
    throw InputError(name + ": has no known detection head (" + describe(outputs) + " at " +
                     std::to_string(input_width_) + " x " + std::to_string(input_height_) + " px" +
                     (whole ? "" : ", where YOLO heads need multiples of 32") +
                     "); export it without NMS as one of: " + known_heads() +
                     (inference() == Inference::opencv ? ", transformers (DETR) for ONNX Runtime alone" : ""));
  layout_ = *layout;
  const bool as_in_coco = layout_.head->numbered_as_in_coco, own_labels = !options_.labels.empty();
  if (!own_labels) labels_ = as_in_coco ? numbered_coco_labels() : coco_labels();
  const auto classes = static_cast<size_t>(layout_.classes);  // 0: its outputs do not say
  const bool lack_the_last = as_in_coco && own_labels && labels_.size() + 1 == classes;
  if (classes != 0 && labels_.size() != classes && !lack_the_last)
    throw InputError(own_labels
                         ? options_.labels.string() + ": " + std::to_string(labels_.size()) + " labels for the " +
                               std::to_string(classes) + " classes of " + name + "; write one per class and line"
                         : name + ": the graph scores " + std::to_string(classes) + " classes, COCO has " +
                               std::to_string(labels_.size()) + "; give a file with its labels");
  wanted_.classes = movable_classes(options_, labels_);
}

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
  const DetectorHead& head = *layout_.head;
  const Letterbox letterbox =
      Letterbox::place(head.preprocessing.fit, image.grey.width, image.grey.height, input_width_, input_height_);
  fill_blob(image, letterbox, head.preprocessing, &blob_);
  const std::vector<OnnxNetwork::Output> outputs = network_->forward(blob_, input_width_, input_height_);
  if (recognise_head(outputs, input_width_, input_height_) != layout_)
    throw InputError(options_.model.string() + ": puts out other sizes than it did at first (" + describe(outputs) +
                     "); export it with outputs of fixed size");
  std::vector<Prediction> predictions = head.decode(layout_, outputs, input_width_, input_height_, wanted_);
  Detections found;
  for (const Prediction& p : suppress_overlaps(std::move(predictions), head.transformer ? 1 : kMaxOverlap)) {
    const Box box = clip(letterbox.to_image(p.box), image.grey.width, image.grey.height);
    if (!(box.w > 0 && box.h > 0)) continue;
    found.boxes.push_back({labels_[static_cast<size_t>(p.class_id)], box, p.score});
    if (head.mask == nullptr) continue;
    if (found.mask.empty()) found.mask = GreyImage(image.grey.width, image.grey.height, 0);
    paint_mask(head.mask(layout_, outputs, p), letterbox, box, &found.mask);
  }
  return found;
}

}  // namespace dkb
