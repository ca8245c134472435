// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/dynamic_stage.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "dkb/detection/mask_folder.h"
#include "dkb/solver/absolute_pose.h"
#include "dkb/solver/pose_optimiser.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

std::vector<Detection> detections_of(const auto& carried) {
  std::vector<Detection> boxes;
  for (const auto& c : carried) boxes.push_back(c.detection);
  return boxes;
}

// Score of the motion segmentation below which a cell was seen to stand still; it runs from -1 to 3.
constexpr float kStill = -0.3f;

// What was seen to stand still before the object came is no part of it.
void clear_still(MoverMask& mask, const Image<float>& score, int score_cell) {
  for (int y = 0; y < mask.cells.height(); ++y)
    for (int x = 0; x < mask.cells.width(); ++x) {
      const int sx = (x * mask.cell + mask.cell / 2) / score_cell, sy = (y * mask.cell + mask.cell / 2) / score_cell;
      if (score.contains(sx, sy) && score(sx, sy) < kStill) mask.cells(x, y) = 0;
    }
}

float depth_near(const DepthImage& depth, float x, float y) {
  const int ix = static_cast<int>(x + 0.5f), iy = static_cast<int>(y + 0.5f);
  return depth.contains(ix, iy) ? depth(ix, iy) : 0.0f;
}

}  // namespace

void DynamicsOptions::check() const {
  paper.check();
  epipolar.check();
  multiview.check();
  silhouette.check();
  motion.check();
  flow.check();
  carry.check();
  require_option(points_per_box >= 4, "dynamics.points_per_box", points_per_box, "at least 4");
  require_option(support_cell >= 2 && support_cell <= 32, "dynamics.support_cell", support_cell, "2 ... 32 px");
  require_option(missed_results >= 0, "dynamics.missed_results", missed_results, "at least 0");
}

DynamicStage::DynamicStage(const CameraModel& camera, const DynamicsOptions& options, DetectorSet detectors)
    : camera_(camera),
      options_(options),
      flow_(options.flow),
      schedule_(detectors.schedule),
      prompt_(std::move(detectors.prompt)) {
  options_.check();
  schedule_.check();
  segments_motion_ = detectors.motion;
  // The default filter asks the segmentation also beside other detectors: it knows what of a box is old background.
  const bool supports = options_.filter == FilterKind::standard && (detectors.slow != nullptr || !prompt_.empty());
  if (!detectors.motion) options_.motion.cell = options_.support_cell;
  if (detectors.motion || supports) motion_.emplace(camera, options_.motion);
  if (detectors.slow) slow_ = std::make_unique<DetectionThread>(std::move(detectors.slow), schedule_);
}

void DynamicStage::commit(const std::optional<Rigid3>& cam_from_world) {
  if (motion_ && options_.filter != FilterKind::none) motion_->commit(cam_from_world);
}

void DynamicStage::move_world(const Rigid3& new_world_from_old_world) {
  if (motion_) motion_->move_world(new_world_from_old_world);
}

void DynamicStage::note_keyframe() {
  if (past_.empty()) return;
  past_.back().keyframe = true;
  if (motion_) past_.back().score = motion_->score();
}

std::vector<PointMotion> DynamicStage::follow(const PastFrame& from, const ImagePyramid& to,
                                              const std::vector<Detection>& boxes) const {
  std::vector<Eigen::Vector2f> points;
  std::vector<uint8_t> chosen(from.corners.size(), 0);
  for (const Detection& d : boxes) {
    std::vector<size_t> inside;
    for (size_t i = 0; i < from.corners.size(); ++i)
      if (!chosen[i] && d.box.contains(from.corners[i].x(), from.corners[i].y())) inside.push_back(i);
    const size_t step = std::max<size_t>(1, inside.size() / static_cast<size_t>(options_.points_per_box));
    for (size_t k = 0; k < inside.size(); k += step) {
      chosen[inside[k]] = 1;
      points.push_back(from.corners[inside[k]]);
    }
  }
  std::vector<PointMotion> motions;
  const auto results = flow_.track(*from.pyramid, to, points);
  for (size_t i = 0; i < points.size(); ++i)
    if (results[i].found)
      motions.push_back({points[i].x(), points[i].y(), results[i].position.x(), results[i].position.y()});
  return motions;
}

void DynamicStage::mark_keyframes(const PastFrame& source, const Detections& detections) {
  for (const PastFrame& p : past_) {
    if (!p.keyframe) continue;
    Detections there = detections;
    if (p.frame != source.frame)
      there = carry(detections, follow(source, *p.pyramid, detections.boxes), std::abs(p.frame - source.frame),
                    camera_.width, camera_.height, options_.carry);
    late_.push_back({p.frame, silhouettes(p.image->depth, there.boxes, options_.silhouette)});
    if (!p.score.empty()) clear_still(late_.back().mask, p.score, options_.motion.cell);
  }
}

void DynamicStage::receive(const Context& context, const std::shared_ptr<const ImagePyramid>& pyramid) {
  for (const DueDetections& due : std::exchange(due_, {})) {
    const PastFrame* source = nullptr;
    for (const PastFrame& p : past_)
      if (p.frame == due.frame) source = &p;
    Detections now = due.detections;
    if (source != nullptr) {
      // Keyframes since the last detection may have let people into the map meanwhile.
      if (options_.filter == FilterKind::standard && !due.detections.boxes.empty())
        mark_keyframes(*source, due.detections);
      now = carry(due.detections, follow(*source, *pyramid, due.detections.boxes), context.frame - due.frame,
                  camera_.width, camera_.height, options_.carry);
    }
    std::vector<Carried> next;
    for (const Detection& d : now.boxes) next.push_back({d, 0});
    // What the detector overlooks once or twice does not vanish.
    for (const Carried& old : carried_) {
      const bool seen_again = std::any_of(now.boxes.begin(), now.boxes.end(), [&](const Detection& d) {
        return intersection_over_union(d.box, old.detection.box) > 0.3f;
      });
      if (!seen_again && old.missed < options_.missed_results) next.push_back({old.detection, old.missed + 1});
    }
    carried_ = std::move(next);
  }
}

std::vector<FilterFeature> DynamicStage::describe(const Context& context, const ImagePyramid& pyramid,
                                                  bool with_flow) const {
  // The others ask only where in the image a corner lies.
  const bool in_space = options_.filter == FilterKind::paper || options_.filter == FilterKind::epipolar ||
                        options_.filter == FilterKind::multiview;
  const auto& corners = context.orb->corners;
  std::vector<FilterFeature> features(corners.size());
  std::vector<Eigen::Vector2f> points(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    FilterFeature& f = features[i];
    points[i] = {corners[i].x, corners[i].y};
    f.image_pixel = points[i].cast<double>();
    if (!in_space) continue;
    f.pixel = (*context.undistort)(corners[i].x, corners[i].y).cast<double>();
    f.depth = depth_near(context.image->depth, corners[i].x, corners[i].y);
  }
  if (!with_flow || past_.empty()) return features;
  const PastFrame& before = past_.back();
  const auto results = flow_.track(pyramid, *before.pyramid, points);
  for (size_t i = 0; i < features.size(); ++i) {
    if (!results[i].found) continue;
    const Eigen::Vector2f at = results[i].position;
    features[i].flowed = true;
    features[i].previous_pixel = (*context.undistort)(at.x(), at.y()).cast<double>();
    features[i].previous_depth = depth_near(before.image->depth, at.x(), at.y());
  }
  return features;
}

// DKB section 3.1, with our decision: the motion comes from points outside all boxes; too few of them, or too lopsided,
// and it comes from all points by RANSAC around the motion model's.
Rigid3 DynamicStage::own_motion(const std::vector<FilterFeature>& features, const std::vector<Detection>& boxes,
                                const Rigid3& expected) const {
  const auto box = box_of_each(features, boxes);
  const auto observe = [&](bool outside_only) {
    std::vector<PoseObservation> observations;
    std::vector<uint8_t> cells(9, 0);
    for (size_t i = 0; i < features.size(); ++i) {
      const FilterFeature& f = features[i];
      if (!f.flowed || !(f.previous_depth > 0) || (outside_only && box[i] >= 0)) continue;
      PoseObservation o;
      o.point_in_world = camera_.unproject(f.previous_pixel, f.previous_depth);
      o.pixel = f.pixel;
      observations.push_back(o);
      const int column = std::clamp(static_cast<int>(3 * f.pixel.x() / camera_.width), 0, 2);
      const int row = std::clamp(static_cast<int>(3 * f.pixel.y() / camera_.height), 0, 2);
      cells[static_cast<size_t>(3 * row + column)] = 1;
    }
    return std::pair(observations, std::count(cells.begin(), cells.end(), uint8_t{1}));
  };
  auto [outside, cells] = observe(true);
  if (outside.size() >= 20 && cells >= 3) {
    const PoseEstimate pose = optimise_pose(camera_, expected, outside);
    return pose.ok ? pose.cam_from_world : expected;
  }
  const auto all = observe(false).first;
  const RansacPose pose = estimate_absolute_pose(camera_, all);
  return pose.ok ? pose.pose : expected;
}

void DynamicStage::begin_frame(FrameIndex frame, std::shared_ptr<const RgbdImage> image) {
  if (!slow_ || options_.filter == FilterKind::none) return;
  slow_->push(frame, std::move(image));
  due_ = slow_->take_due(frame);
}

// carry() may drop boxes that left the image, so each goes alone and keeps its count of misses.
void DynamicStage::move_boxes_here(const ImagePyramid& pyramid) {
  if (past_.empty() || carried_.empty()) return;
  const auto motions = follow(past_.back(), pyramid, detections_of(carried_));
  std::vector<Carried> moved;
  for (const Carried& c : carried_) {
    Detections one;
    one.boxes = {c.detection};
    const Detections there = carry(one, motions, 1, camera_.width, camera_.height, options_.carry);
    if (!there.boxes.empty()) moved.push_back({there.boxes.front(), c.missed});
  }
  carried_ = std::move(moved);
}

MoverMask DynamicStage::ask_prompt_detectors(const RgbdImage& image, std::vector<Detection>& boxes) const {
  MoverMask given;
  for (const auto& detector : prompt_) {
    const Detections d = detector->detect(image);
    boxes.insert(boxes.end(), d.boxes.begin(), d.boxes.end());
    if (!d.mask.empty()) given = {1, d.mask};
  }
  return given;
}

MoverMask DynamicStage::segment_motion(const Context& context, std::vector<Detection>& boxes) {
  if (!motion_) return {};
  const Stopwatch watch;
  MoverMask moving;
  if (segments_motion_)
    moving = motion_->segment(*context.image, context.cam_from_world);
  else
    motion_->observe(*context.image, context.cam_from_world);
  times_.add("motion", watch.ms());
  // The other filters know boxes only.
  if (options_.filter != FilterKind::standard && !moving.empty())
    for (const Box& b : region_boxes(moving.cells, 4 * 4)) {
      const float c = static_cast<float>(moving.cell);
      boxes.push_back({"mover", {c * b.x, c * b.y, c * b.w, c * b.h}, 1.0f});
    }
  return moving;
}

void DynamicStage::filter(const Context& context, const std::vector<FilterFeature>& features, const MoverMask& given,
                          const MoverMask& moving, DynamicScene& scene) const {
  const auto motion = [&] { return own_motion(features, scene.boxes, context.current_from_previous); };
  switch (options_.filter) {
    case FilterKind::none:
      break;
    case FilterKind::box:
      scene.dynamic = box_filter(features, scene.boxes);
      break;
    case FilterKind::epipolar:
      scene.dynamic = epipolar_filter(features, scene.boxes, camera_, motion(), options_.epipolar);
      break;
    case FilterKind::paper:
      scene.dynamic = paper_filter(features, scene.boxes, camera_, motion(), options_.paper);
      break;
    case FilterKind::multiview:
      scene.dynamic = multiview_filter(features, context.keyframe_points_in_camera, camera_, context.image->depth,
                                       options_.multiview);
      break;
    case FilterKind::standard:
      scene.mask = given.empty() ? silhouettes(context.image->depth, scene.boxes, options_.silhouette) : MoverMask{};
      if (motion_) clear_still(scene.mask, motion_->score(), options_.motion.cell);
      unite(scene.mask, given, camera_.width, camera_.height);
      if (segments_motion_) unite(scene.mask, moving, camera_.width, camera_.height);
      scene.dynamic = mask_filter(features, scene.mask);
      break;
  }
}

void DynamicStage::remember(const Context& context, std::shared_ptr<const ImagePyramid> pyramid) {
  PastFrame now;
  now.frame = context.frame;
  now.image = context.image;
  now.pyramid = std::move(pyramid);
  for (const Corner& c : context.orb->corners) now.corners.emplace_back(c.x, c.y);
  past_.push_back(std::move(now));
  const size_t kept = slow_ ? static_cast<size_t>(schedule_.latency + schedule_.every) + 1 : 1;
  while (past_.size() > kept) past_.pop_front();
}

DynamicScene DynamicStage::process(const Context& context) {
  DynamicScene scene;
  scene.dynamic.assign(context.orb->corners.size(), 0);
  if (options_.filter == FilterKind::none) return scene;

  Stopwatch watch;
  const bool paper_like = options_.filter == FilterKind::paper || options_.filter == FilterKind::epipolar;
  std::shared_ptr<const ImagePyramid> pyramid;
  if (slow_ || paper_like) {
    auto made = std::make_shared<ImagePyramid>(options_.flow.pyramid());
    made->build(context.image->grey);
    pyramid = std::move(made);
  }
  if (slow_) {
    move_boxes_here(*pyramid);
    receive(context, pyramid);
  }
  scene.boxes = detections_of(carried_);
  const MoverMask given = ask_prompt_detectors(*context.image, scene.boxes);
  const MoverMask moving = segment_motion(context, scene.boxes);
  const bool with_flow = paper_like && !scene.boxes.empty();
  const std::vector<FilterFeature> features = describe(context, pyramid ? *pyramid : ImagePyramid(), with_flow);
  times_.add("flow", watch.ms());

  watch = Stopwatch();
  filter(context, features, given, moving, scene);
  times_.add("filter", watch.ms());
  if (pyramid) remember(context, std::move(pyramid));
  return scene;
}

std::vector<LateMask> DynamicStage::take_late_masks() {
  return std::exchange(late_, {});
}

std::optional<std::string> DynamicStage::take_warning() {
  return slow_ ? slow_->take_error() : std::nullopt;
}

std::string DynamicStage::detector_kind() const {
  std::string kind = slow_ ? slow_->stats().kind : "";
  if (segments_motion_) kind += kind.empty() ? "motion" : "+motion";
  for (const auto& d : prompt_) kind += (kind.empty() ? "" : "+") + d->kind();
  return kind.empty() ? "none" : kind;
}

double DynamicStage::detector_rate_hz() const {
  return slow_ ? slow_->stats().rate_hz : 0;
}
int DynamicStage::detector_latency() const {
  return slow_ ? slow_->stats().latency_frames : 0;
}
StageTimes DynamicStage::detector_times() const {
  return slow_ ? slow_->times() : StageTimes();
}
void DynamicStage::stop() {
  if (slow_) slow_->stop();
}

}  // namespace dkb
