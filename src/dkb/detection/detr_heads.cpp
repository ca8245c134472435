// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/head_families.h"

// Detection transformers. Their outputs are told apart by name, since a model of four classes scores them in the shape
// of its boxes.
namespace dkb {
namespace {

// As trained by RT-DETR and D-FINE.
constexpr Preprocessing kStretched{.fit = Preprocessing::Fit::stretched};

// Boxes 1 x N x 4: centre and size, as shares of the input; logits 1 x N x C.
std::optional<HeadLayout> boxes_and_logits(NetworkOutputs outputs, const char* boxes_name, const char* logits_name) {
  const auto boxes = output_named(outputs, boxes_name), logits = output_named(outputs, logits_name);
  if (!boxes || !logits || !has_dims(outputs[*boxes], {1, -1, 4})) return std::nullopt;
  const int predictions = outputs[*boxes].dims[1];
  if (!has_dims(outputs[*logits], {1, predictions, -1}) || outputs[*logits].dims[2] == 0) return std::nullopt;
  return HeadLayout{nullptr, outputs[*logits].dims[2], predictions, {*boxes, *logits}};
}

std::vector<Prediction> decode_logits(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                      const Wanted& wanted) {
  const float *box = outputs[layout.outputs[0]].values.data(), *logits = outputs[layout.outputs[1]].values.data();
  const auto w = static_cast<float>(width), h = static_cast<float>(height);
  std::vector<Prediction> out;
  for (size_t i = 0; i < static_cast<size_t>(layout.predictions); ++i, box += 4, logits += layout.classes) {
    const int class_id = best_class(logits, layout.classes);
    const float score = 1 / (1 + std::exp(-logits[class_id]));
    if (wanted.takes(class_id, score))
      keep({class_id, box_about(box[0] * w, box[1] * h, box[2] * w, box[3] * h), score, i}, &out);
  }
  return out;
}

std::optional<HeadLayout> recognise_rf_detr(NetworkOutputs outputs, int, int) {
  return boxes_and_logits(outputs, "dets", "labels");
}

std::optional<HeadLayout> recognise_rf_detr_seg(NetworkOutputs outputs, int width, int height) {
  auto layout = recognise_rf_detr(outputs, width, height);
  const auto masks = output_named(outputs, "masks");
  if (!layout || !masks || !has_dims(outputs[*masks], {1, layout->predictions, -1, -1}) ||
      outputs[*masks].values.empty())
    return std::nullopt;
  layout->outputs.push_back(*masks);
  return layout;
}

MaskLogits mask_rf_detr(const HeadLayout& layout, NetworkOutputs outputs, const Prediction& prediction) {
  const OnnxNetwork::Output& masks = outputs[layout.outputs[2]];
  const size_t size = static_cast<size_t>(masks.dims[2]) * static_cast<size_t>(masks.dims[3]);
  const auto own = masks.values.subspan(prediction.index * size, size);
  return {masks.dims[3], masks.dims[2], {own.begin(), own.end()}};
}

std::optional<HeadLayout> recognise_scored(NetworkOutputs outputs, int, int) {
  const auto labels = output_named(outputs, "labels"), boxes = output_named(outputs, "boxes"),
             scores = output_named(outputs, "scores");
  if (!labels || !boxes || !scores || !has_dims(outputs[*boxes], {1, -1, 4})) return std::nullopt;
  const int predictions = outputs[*boxes].dims[1];
  if (!has_dims(outputs[*labels], {1, predictions}) || !has_dims(outputs[*scores], {1, predictions}))
    return std::nullopt;
  return HeadLayout{nullptr, 0, predictions, {*labels, *boxes, *scores}};
}

std::vector<Prediction> decode_scored(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                      const Wanted& wanted) {
  const auto values = [&](size_t i) { return outputs[layout.outputs[i]].values.data(); };
  const float *labels = values(0), *box = values(1), *scores = values(2);
  std::vector<Prediction> out;
  for (size_t i = 0; i < static_cast<size_t>(layout.predictions); ++i, box += 4) {
    const bool is_class = labels[i] >= 0 && labels[i] < static_cast<float>(wanted.classes.size());
    if (is_class && wanted.takes(static_cast<int>(labels[i]), scores[i]))
      keep({static_cast<int>(labels[i]), box_between(box[0], box[1], box[2], box[3]), scores[i]}, &out);
  }
  return out;
}

}  // namespace

std::vector<DetectorHead> detr_heads() {
  const DetectorHead rf_detr{.name = "RF-DETR",
                             .outputs = "dets 1 x N x 4 and labels 1 x N x C",
                             .preprocessing = stretched_by_imagenet(false),
                             .usual_input = 512,
                             .transformer = true,
                             .numbered_as_in_coco = true,
                             .recognise = recognise_rf_detr,
                             .decode = decode_logits};
  // The same with masks 1 x N x height x width over all of the input.
  DetectorHead rf_detr_seg = rf_detr;
  rf_detr_seg.name = "RF-DETR-Seg";
  rf_detr_seg.outputs = "those of RF-DETR and masks 1 x N x H x W";
  rf_detr_seg.usual_input = 384;
  rf_detr_seg.recognise = recognise_rf_detr_seg;
  rf_detr_seg.mask = mask_rf_detr;
  const DetectorHead d_fine{
      .name = "D-FINE or RT-DETR",
      .outputs = "logits 1 x N x C and pred_boxes 1 x N x 4",
      .preprocessing = kStretched,
      .transformer = true,
      .recognise = [](NetworkOutputs outputs, int, int) { return boxes_and_logits(outputs, "pred_boxes", "logits"); },
      .decode = decode_logits};
  // RT-DETR and D-FINE as their projects export them: already scored, with boxes in pixels of the size that the second
  // input gives, which is the input's.
  const DetectorHead scored{.name = "D-FINE or RT-DETR, scored",
                            .outputs = "labels 1 x N, boxes 1 x N x 4 and scores 1 x N",
                            .preprocessing = kStretched,
                            .transformer = true,
                            .recognise = recognise_scored,
                            .decode = decode_scored};
  return {rf_detr_seg, rf_detr, d_fine, scored};
}

}  // namespace dkb
