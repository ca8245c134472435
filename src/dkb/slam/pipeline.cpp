// SPDX-License-Identifier: Apache-2.0
// What happens to a frame, in order. What each step means for map and robot is in pipeline_steps.cpp.
#include "dkb/slam/pipeline.h"

#include <limits>
#include <utility>

namespace dkb {

// One frame, as in DKB section 3: features, what moves, pose, keyframe decision. Mapping happens beside it.
FrameResult Pipeline::process(const Frame& given) {
  const Frame frame = repeated_depth_.left_out(priors_.calibrated(given));
  last_stamp_ns_ = frame.stamp_ns();
  rate_.add(last_stamp_ns_);
  if (std::string doubt = stamp_doubt_.add(last_stamp_ns_); !doubt.empty())
    note(Event::Kind::warning, std::move(doubt));
  if (std::string warning = repeated_depth_.take_warning(); !warning.empty())
    note(Event::Kind::warning, std::move(warning));
  if (load_) shed_load();
  FrameResult result;
  const Stopwatch whole;
  const FrameIndex index = next_frame_;
  std::vector<DueDetections> detections = scenes_.take_due(index, frame);
  result.waiting_ms = whole.ms();
  const Expectation expected = expect(frame);
  scenes_.begin(index, frame, std::move(detections), expected);
  const Scene scene = scenes_.look(extract(frame), undistort_, expected);  // DKB 3.1
  result.waiting_ms += take_due_map(!options_.pipeline.realtime);  // as late as it may come: nothing before needs it
  follow_motion(scene);
  retract_late(scene.late_masks);
  const UsableFeatures usable = usable_features(scene);
  look_for_movers(scene, expected);
  TrackedFrame tracked = track(scene, usable);
  weigh_evidence(scene, tracked);
  const KeyframeDecision decision = decide(scene, tracked);      // DKB 3.2
  if (decision.insert) insert_keyframe(scene, usable, tracked);  // DKB 3.3 happens there
  result.features = report_features(scene, usable, tracked);
  publish(scene, tracked, decision, result);
  scenes_.ask_slow_detector(index, frame);  // now that no other thread works for this frame
  result.tracking_ms = whole.ms() - result.waiting_ms;
  record_.add_time("tracking", result.tracking_ms);
  result.stages = record_.take_news();
  if (load_) load_->end(steady_ns());
  return result;
}

void Pipeline::finish() {
  if (start_) push_start(nullptr);
  const FrameIndex due = mapping_due();
  KeyframePacket report = tracker_.make_report();
  if (next_keyframe_ > 0 && !localize_only_) mapping_.push(std::move(report), due);
  bool adjusted_last = !options_.final_ba;
  while (true) {
    if (const auto view = mapping_.drain()) take_view(*view);
    if (localize_only_ || next_keyframe_ == 0) break;
    loop_.offer(tracker_.map().shared_view(), next_frame_, rate_, false);
    auto corrections = loop_.take_due(std::numeric_limits<FrameIndex>::max(), true);
    if (corrections.empty() && loop_.idle()) {
      if (adjusted_last) break;
      adjusted_last = true;
      loop_.want_adjustment();
    }
    correct(std::move(corrections), due);
  }
  collect_times();
}

}  // namespace dkb
