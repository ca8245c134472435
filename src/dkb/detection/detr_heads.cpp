// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "dkb/detection/head_families.h"

// Detection transformers: one prediction an object, so nothing is to be suppressed. Their outputs are told apart by
// name, since a model of four classes scores them in the shape of its boxes.
namespace dkb {
namespace {

// As trained by RT-DETR and D-FINE.
constexpr Preprocessing kStretched{.fit = Preprocessing::Fit::stretched};

// Boxes 1 x N x 4: centre and size, as shares of the input; logits 1 x N x C.
class LogitsAndBoxes : public DetectorHead {
 public:
  LogitsAndBoxes(const Facts& its_facts, const char* boxes, const char* logits)
      : DetectorHead(its_facts), boxes_(boxes), logits_(logits) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int, int) const override {
    const auto boxes = output_named(outputs, boxes_), logits = output_named(outputs, logits_);
    if (!boxes || !logits || !has_dims(outputs[*boxes], {1, -1, 4})) return std::nullopt;
    const int predictions = outputs[*boxes].dims[1];
    if (!has_dims(outputs[*logits], {1, predictions, -1}) || outputs[*logits].dims[2] == 0) return std::nullopt;
    return HeadLayout{this, outputs[*logits].dims[2], predictions, {*boxes, *logits}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int width, int height,
                                 const Wanted& wanted) const override {
    const float *box = outputs[layout.outputs[0]].values.data(), *logits = outputs[layout.outputs[1]].values.data();
    const auto w = static_cast<float>(width), h = static_cast<float>(height);
    std::vector<Prediction> out;
    for (size_t i = 0; i < static_cast<size_t>(layout.predictions); ++i, box += 4, logits += layout.classes) {
      const float* best = std::max_element(logits, logits + layout.classes);
      const int class_id = static_cast<int>(best - logits);
      const float score = 1 / (1 + std::exp(-*best));
      if (wanted.takes(class_id, score))
        keep({class_id, box_about(box[0] * w, box[1] * h, box[2] * w, box[3] * h), score, i}, &out);
    }
    return out;
  }

 private:
  const char *boxes_, *logits_;
};

class RfDetr : public LogitsAndBoxes {
 public:
  RfDetr()
      : RfDetr({.name = "RF-DETR",
                .outputs = "dets 1 x N x 4 and labels 1 x N x C",
                .preprocessing = stretched_by_imagenet(false),
                .usual_input = 512,
                .square = true,
                .one_box_an_object = true,
                .numbered_as_in_coco = true}) {}

 protected:
  explicit RfDetr(const Facts& its_facts) : LogitsAndBoxes(its_facts, "dets", "labels") {}
};

// The same with masks 1 x N x height x width over all of the input.
class RfDetrSeg final : public RfDetr {
 public:
  RfDetrSeg()
      : RfDetr({.name = "RF-DETR-Seg",
                .outputs = "the same and masks 1 x N x H x W",
                .preprocessing = stretched_by_imagenet(false),
                .usual_input = 384,
                .square = true,
                .one_box_an_object = true,
                .numbered_as_in_coco = true,
                .masks = true}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int width, int height) const override {
    auto layout = RfDetr::recognise(outputs, width, height);
    const auto masks = output_named(outputs, "masks");
    if (!layout || !masks || !has_dims(outputs[*masks], {1, layout->predictions, -1, -1}) ||
        outputs[*masks].values.empty())
      return std::nullopt;
    layout->outputs.push_back(*masks);
    return layout;
  }
  MaskLogits mask(const HeadLayout& layout, NetworkOutputs outputs, const Prediction& prediction) const override {
    const OnnxNetwork::Output& masks = outputs[layout.outputs[2]];
    const size_t size = static_cast<size_t>(masks.dims[2]) * static_cast<size_t>(masks.dims[3]);
    const auto own = masks.values.subspan(prediction.index * size, size);
    return {masks.dims[3], masks.dims[2], {own.begin(), own.end()}};
  }
};

// RT-DETR and D-FINE as their projects export them: already scored, with boxes in pixels of the size that the second
// input gives, which is the input's.
class ScoredBoxes final : public DetectorHead {
 public:
  ScoredBoxes()
      : DetectorHead({.name = "D-FINE or RT-DETR, scored",
                      .outputs = "labels 1 x N, boxes 1 x N x 4 and scores 1 x N",
                      .preprocessing = kStretched,
                      .square = true,
                      .one_box_an_object = true}) {}

  std::optional<HeadLayout> recognise(NetworkOutputs outputs, int, int) const override {
    const auto labels = output_named(outputs, "labels"), boxes = output_named(outputs, "boxes"),
               scores = output_named(outputs, "scores");
    if (!labels || !boxes || !scores || !has_dims(outputs[*boxes], {1, -1, 4})) return std::nullopt;
    const int predictions = outputs[*boxes].dims[1];
    if (!has_dims(outputs[*labels], {1, predictions}) || !has_dims(outputs[*scores], {1, predictions}))
      return std::nullopt;
    return HeadLayout{this, 0, predictions, {*labels, *boxes, *scores}};
  }
  std::vector<Prediction> decode(const HeadLayout& layout, NetworkOutputs outputs, int, int,
                                 const Wanted& wanted) const override {
    const auto values = [&](size_t i) { return outputs[layout.outputs[i]].values.data(); };
    const float *labels = values(0), *box = values(1), *scores = values(2);
    std::vector<Prediction> out;
    for (size_t i = 0; i < static_cast<size_t>(layout.predictions); ++i, box += 4) {
      const bool is_class = labels[i] >= 0 && labels[i] < static_cast<float>(wanted.classes.size());
      if (is_class && wanted.takes(static_cast<int>(labels[i]), scores[i]))
        keep({static_cast<int>(labels[i]), box_between(box[0], box[1], box[2], box[3]), scores[i], i}, &out);
    }
    return out;
  }
};

}  // namespace

std::vector<const DetectorHead*> detr_heads() {
  static const RfDetrSeg rf_detr_seg;
  static const RfDetr rf_detr;
  static const LogitsAndBoxes d_fine({.name = "D-FINE or RT-DETR",
                                      .outputs = "logits 1 x N x C and pred_boxes 1 x N x 4",
                                      .preprocessing = kStretched,
                                      .square = true,
                                      .one_box_an_object = true},
                                     "pred_boxes", "logits");
  static const ScoredBoxes scored;
  return {&rf_detr_seg, &rf_detr, &d_fine, &scored};
}

}  // namespace dkb
