// SPDX-License-Identifier: Apache-2.0
// What happens to a frame, in order.
#include <algorithm>
#include <limits>

#include "dkb/slam/slam_system_impl.h"
#include "dkb/util/errors.h"

namespace dkb {

void SlamSystem::Impl::start(Map map) {
  loop_.reset();
  mapping_.reset();
  const OrbOptions& orb = options_.features;
  tracker_ =
      std::make_unique<Tracker>(camera_, options_.noise, orb.scale, orb.levels, options_.tracking, options_.seed);
  if (options_.keyframe_policy == KeyframePolicyKind::adaptive)
    policy_ = std::make_unique<AdaptiveKeyframePolicy>(options_.adaptive_keyframes, camera_.width, camera_.height);
  else
    policy_ = std::make_unique<BaselineKeyframePolicy>(options_.baseline_keyframes);
  tracker_->set_start(options_.base_from_cam.inverse());
  next_keyframe_ = map.keyframe_count();
  last_keyframe_ = next_keyframe_ - 1;
  if (next_keyframe_ > 0) {
    map.date_back();
    tracker_->take_view(map.snapshot());
    tracker_->reset_motion();
  }
  mapping_ = std::make_unique<MappingStage>(
      LocalMapper(camera_, options_.noise, orb.scale, orb.levels, options_.mapping, std::move(map)),
      options_.pipeline.threaded);
  loop_ = std::make_unique<LoopStage>(Optics{camera_, options_.noise, orb.scale, orb.levels}, options_.loop_closing,
                                      options_.mapping.ba, options_.seed, options_.pipeline.threaded);
  loop_->start_at(next_keyframe_);
  records_.clear();
  next_frame_ = 0;
  lost_frames_ = 0;
  world_from_odom_ = {};
  odom_from_cam_ = options_.base_from_cam;
  last_keyframe_frame_ = 0;
  last_relocalisation_frame_ = -1000000;
  feature_reports_.clear();
  scene_ = {};
  evidence_.emplace(options_.evidence);
  ReadoutOptions readout = options_.readout;
  readout.estimate = readout.estimate && options_.depth.model_rolling_shutter;
  readout_.emplace(camera_, options_.noise, orb.scale, readout);
  movers_.emplace(camera_, options_.movers);
  recent_keyframes_.clear();
  statistics_ = {};
  times_ = {};
}

void SlamSystem::Impl::take_map(bool wait) {
  const auto view = mapping_->take_due(next_frame_, wait);
  if (view) take_view(*view);
  if (localise_only_) return;
  if (view && mapping_->outstanding_corrections() == 0) loop_->offer(*view, next_frame_, !wait);
  for (auto& correction : loop_->take_due(next_frame_, wait))
    mapping_->push(std::move(correction), next_frame_ + options_.pipeline.mapper_latency);
}

void SlamSystem::Impl::take_view(const MapView& view) {
  const Rigid3 new_world_from_old = tracker_->take_view(view);
  world_from_odom_ = new_world_from_old * world_from_odom_;
  dynamics_.move_world(new_world_from_old);
  movers_->rebase(new_world_from_old);
}

void SlamSystem::Impl::extract(const RgbdImage& image) {
  const Stopwatch watch;
  // When movers took most of the last frame's features, the rest of the image gets its half now.
  const auto& last = scene_.dynamic;
  const bool crowded = 2 * std::count(last.begin(), last.end(), uint8_t{1}) > static_cast<std::ptrdiff_t>(last.size());
  orb_ = crowded && !scene_.mask.empty() ? extractor_.extract(image.grey, scene_.mask.cells, scene_.mask.cell)
                                         : extractor_.extract(image.grey);
  times_.add("features", watch.ms());
}

std::vector<Eigen::Vector3d> SlamSystem::Impl::keyframe_points_in_camera(const Rigid3& cam_from_world) const {
  std::vector<Eigen::Vector3d> points;
  const Map& map = tracker_->view();
  const auto keyframes = map.live_keyframes();
  const size_t count = std::min(keyframes.size(), static_cast<size_t>(options_.dynamics.multiview.keyframes));
  for (size_t n = keyframes.size() - count; n < keyframes.size(); ++n) {
    const Keyframe& k = *map.keyframe(keyframes[n]);
    const Rigid3 cam_from_keyframe = cam_from_world * k.cam_from_world.inverse();
    for (const Keypoint& p : k.features->keypoints)
      if (p.depth > 0) points.push_back(cam_from_keyframe * camera_.unproject(p.pixel.cast<double>(), p.depth));
  }
  return points;
}

// Corners on movers go no further (DKB section 3.1): neither tracking nor the map ever sees them.
void SlamSystem::Impl::filter_dynamic(std::shared_ptr<const RgbdImage> image) {
  DynamicStage::Context context;
  context.frame = next_frame_;
  context.orb = &orb_;
  context.undistort = &undistort_;
  const auto& last = tracker_->last_frame();
  context.current_from_previous = last ? tracker_->expected_motion(image->timestamp - last->timestamp) : Rigid3();
  if (last) context.cam_from_world = context.current_from_previous * last->cam_from_world;
  if (last && dynamics_.wants_keyframe_points())
    context.keyframe_points_in_camera = keyframe_points_in_camera(context.cam_from_world);
  context.image = std::move(image);
  scene_ = dynamics_.process(context);
  // The default filter only suspects: what well-known map points explain stays. The others judge for good.
  const bool suspects = options_.dynamics.filter == FilterKind::standard;
  kept_.clear();
  feature_reports_.resize(orb_.corners.size());
  OrbFeatures kept;
  suspect_.clear();
  by_mover_.clear();
  const MoverMask around =
      spread_into_holes(scene_.mask, image_->depth, options_.dynamics.motion.smoothing.distance, camera_.fx);
  for (size_t i = 0; i < orb_.corners.size(); ++i) {
    feature_reports_[i] = {orb_.corners[i].x, orb_.corners[i].y,
                           scene_.dynamic[i] ? FeatureState::dynamic : FeatureState::unused};
    if (scene_.dynamic[i] && !suspects) continue;
    kept_.push_back(i);
    suspect_.push_back(scene_.dynamic[i]);
    by_mover_.push_back(around.at(orb_.corners[i].x, orb_.corners[i].y) ? 1 : 0);
    kept.corners.push_back(orb_.corners[i]);
    kept.descriptors.push_back(orb_.descriptors[i]);
  }
  orb_ = std::move(kept);
}

void SlamSystem::Impl::report_features(const TrackedFrame& frame) {
  for (size_t f = 0; f < frame.points.size(); ++f) {
    FeatureState& state = feature_reports_[source_feature(frame, f)].state;
    if (frame.points[f] != kNoPoint || frame.odometry[f]) state = FeatureState::used;
    if (frame.outlier[f] && state != FeatureState::dynamic) state = FeatureState::outlier;
  }
  for (const FeatureReport& f : feature_reports_) statistics_.features_removed += f.state == FeatureState::dynamic;
}

// Map points that stand where a mover is, at the mover's depth, lose trust; those that fit the still world regain it.
void SlamSystem::Impl::weigh_evidence() {
  if (scene_.mask.empty()) return;
  const auto& last = *tracker_->last_frame();
  std::vector<PointId> matched;
  for (PointId p : last.points)
    if (p != kNoPoint) {
      evidence_->fits_still_world(p);
      matched.push_back(p);
    }
  std::sort(matched.begin(), matched.end());
  const DepthImage& depth = image_->depth;
  tracker_->visit_points_in_view([&](PointId id, const Eigen::Vector2d& pixel, double z) {
    const Eigen::Vector2f at = image_pixel(pixel);
    if (!scene_.mask.at(at.x(), at.y())) return;
    const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
    if (!depth.contains(x, y) || !(depth(x, y) > 0)) return;
    const double surface = depth(x, y);
    if (std::abs(surface - z) < 0.05 * surface + 0.05 && !std::binary_search(matched.begin(), matched.end(), id))
      evidence_->on_mover(id);
  });
  tracker_->retract(evidence_->take_convicted());
}

// By what a descriptor differs from the image where it should be found. Two random descriptors differ by 128 bits.
std::optional<bool> SlamSystem::Impl::looks_the_same(const Eigen::Vector2d& pixel, double depth, int octave,
                                                     const Descriptor& descriptor) {
  constexpr int kSameBits = 80, kOtherBits = 100;
  constexpr double kDepthGate = 0.07;  // [1] relative
  const Eigen::Vector2f at = image_pixel(pixel);
  const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
  if (!image_->depth.contains(x, y) || !(image_->depth(x, y) > 0)) return std::nullopt;
  const double seen = image_->depth(x, y);
  if (seen < (1 - kDepthGate) * depth) return std::nullopt;  // something stands before it
  if (seen > (1 + kDepthGate) * depth) return false;         // it is not there
  if (!describer_is_set_) describer_.set_image(image_->grey);
  describer_is_set_ = true;
  const auto bits = describer_.distance(at.x(), at.y(), octave, descriptor);
  if (!bits) return std::nullopt;
  if (*bits > kSameBits && *bits < kOtherBits) return std::nullopt;
  return *bits <= kSameBits;
}

// Detections that came after their keyframe: what it made on movers goes.
std::vector<LateMask> SlamSystem::Impl::retract_late() {
  std::vector<LateMask> masks = dynamics_.take_late_masks();
  for (const LateMask& late : masks)
    for (const RecentKeyframe& k : recent_keyframes_) {
      if (k.frame != late.frame) continue;
      std::vector<PointId> points;
      for (size_t f = 0; f < k.features->size(); ++f) {
        const Keypoint& p = k.features->keypoints[f];
        if (late.mask.at(p.image_pixel.x(), p.image_pixel.y()))
          points.push_back(make_point_id(k.id, static_cast<int>(f)));
      }
      tracker_->retract(points);
    }
  return masks;
}

KeyframeDecision SlamSystem::Impl::decide(const TrackOutcome& outcome) {
  const TrackedFrame& frame = outcome.frame;
  if (outcome.wants_first_keyframe) return {true, KeyframeRule::first, "the map starts here"};
  if (localise_only_) return {false, KeyframeRule::none, "the map is not changed"};
  KeyframeQuery q;
  q.frame = frame.index;
  q.last_keyframe_frame = last_keyframe_frame_;
  q.last_relocalisation_frame = last_relocalisation_frame_;
  q.last_keyframe = last_keyframe_;
  q.mapper_idle = mapping_->outstanding() == 0;
  q.tracked_points = frame.inliers;
  for (size_t f = 0; f < frame.points.size(); ++f) {
    const float z = frame.features->keypoints[f].depth;
    if (!(z > 0) || z > options_.tracking.close_depth) continue;
    if (frame.points[f] != kNoPoint)
      ++q.tracked_close_points;
    else
      ++q.creatable_close_points;
  }
  q.reference_points = tracker_->reference_point_count(frame.reference, next_keyframe_ > 2 ? 2 : 1);
  q.cam_from_world = frame.cam_from_world;
  q.last_keyframe_cam_from_world = tracker_->keyframe_pose(q.last_keyframe);
  q.points = &frame.points;
  q.features = frame.features.get();
  q.explain = explain_keyframes_;
  KeyframeDecision decision = policy_->decide(q, tracker_->view());
  statistics_.keyframe_tests.add(decision.tests);
  if (options_.pipeline.realtime && static_cast<int>(mapping_->outstanding()) >= options_.pipeline.mapper_queue)
    return {false, KeyframeRule::none, "mapping has enough to do; " + decision.explanation, decision.tests};
  return decision;
}

void SlamSystem::Impl::insert_keyframe(TrackedFrame& frame) {
  const KeyframeId id = last_keyframe_ = next_keyframe_++;
  KeyframePacket packet = tracker_->make_keyframe(id, frame);
  for (const ProvisionalPoint& p : packet.new_points)
    feature_reports_[source_feature(frame, static_cast<size_t>(p.feature))].state = FeatureState::used;
  dynamics_.note_keyframe();
  recent_keyframes_.push_back({frame.index, id, frame.features});
  const DetectionSchedule& schedule = dynamics_.schedule();
  while (recent_keyframes_.front().frame < frame.index - 2 * (schedule.latency + schedule.every))
    recent_keyframes_.pop_front();
  mapping_->push(std::move(packet), frame.index + options_.pipeline.mapper_latency);
  last_keyframe_frame_ = frame.index;
  frame.reference = id;
  frame.cam_from_reference = {};
  ++statistics_.keyframes_inserted;
}

// Nobody knows how the camera moved while it was lost: odometry goes on from where it was, and the jump is the map's.
void SlamSystem::Impl::keep_odometry_smooth(const TrackOutcome& outcome) {
  if (lost_frames_ == 0 && (outcome.state != TrackingState::relocalised || next_frame_ > 1)) return;
  world_from_odom_ = outcome.frame.cam_from_world.inverse() * odom_from_cam_.inverse();
}

// One frame, as in DKB section 3: features, pose, keyframe decision; mapping happens beside it.
FrameResult SlamSystem::Impl::process(std::shared_ptr<const RgbdImage> image_pointer) {
  image_ = std::move(image_pointer);
  const RgbdImage& image = *image_;
  if (image.grey.width() != camera_.width || image.grey.height() != camera_.height ||
      image.depth.width() != camera_.width || image.depth.height() != camera_.height)
    throw InputError("frame " + std::to_string(next_frame_) + ": its images are not of the camera's size, " +
                     std::to_string(camera_.width) + " x " + std::to_string(camera_.height));
  if (next_frame_ > 0 && !(image.timestamp > last_timestamp_))
    throw InputError("frame " + std::to_string(next_frame_) + ": its stamp is not after the one before it");
  last_timestamp_ = image.timestamp;

  FrameResult result;
  const Stopwatch waiting;
  take_map(!options_.pipeline.realtime);
  result.wait_ms = waiting.ms();
  times_.add("wait_mapper", result.wait_ms);
  dynamics_.begin_frame(next_frame_, image_);
  result.wait_ms = waiting.ms();

  const Stopwatch tracking;
  describer_is_set_ = false;
  extract(image);
  filter_dynamic(image_);
  result.late_masks = retract_late();
  CameraModel camera = camera_;
  camera.readout = readout_->readout();
  const auto features_at = [&](const Vector6d& velocity) {
    RgbdFeatures features = make_rgbd_features(orb_, image, camera, undistort_, velocity, options_.depth);
    for (size_t f = 0; f < features.size(); ++f) {
      features.keypoints[f].suspect = suspect_[f];
      features.keypoints[f].by_mover = by_mover_[f];
    }
    return std::make_shared<const RgbdFeatures>(std::move(features));
  };
  TrackOutcome outcome = tracker_->track(next_frame_, image.timestamp, features_at, !localise_only_,
                                         [this](const auto&... point) { return looks_the_same(point...); });
  TrackedFrame& frame = outcome.frame;
  report_features(frame);
  result.state = outcome.state;
  dynamics_.commit(result.tracked() ? std::optional(frame.cam_from_world) : std::nullopt);

  result.frame = next_frame_++;
  result.timestamp = image.timestamp;
  ++statistics_.frames;
  if (result.tracked()) {
    if (outcome.state == TrackingState::relocalised) {
      last_relocalisation_frame_ = frame.index;
      last_keyframe_ = frame.reference;
      ++statistics_.relocalisations;
    }
    keep_odometry_smooth(outcome);
    weigh_evidence();
    readout_->add(frame, tracker_->velocity(), [this](PointId id) { return tracker_->position(id); });
    const Stopwatch deciding;
    const KeyframeDecision decision = decide(outcome);
    times_.add("keyframe_decision", deciding.ms());
    if (decision.insert) {
      ++statistics_.keyframe_rules[name_of(decision.rule)];
      insert_keyframe(frame);
    }
    if (explain_keyframes_) result.keyframe_explanation = explained(decision);
    result.keyframe = decision.insert;
    result.world_from_cam = frame.cam_from_world.inverse();
    result.world_from_odom = world_from_odom_;
    result.odom_from_cam = odom_from_cam_ = world_from_odom_.inverse() * result.world_from_cam;
    if (options_.dynamics.filter == FilterKind::standard)
      result.movers = movers_->update(image.timestamp, image.depth, scene_.mask, scene_.boxes, result.world_from_cam);
    result.covariance = frame.covariance;
    result.inliers = frame.inliers;
    result.reference = frame.reference;
    records_.push_back(
        {frame.index, frame.timestamp, frame.reference, frame.cam_from_reference, result.world_from_cam});
    ++statistics_.tracked;
    lost_frames_ = 0;
  } else if (outcome.state == TrackingState::lost) {
    ++statistics_.lost;
    ++lost_frames_;
  }
  if (localise_only_) tracker_->make_report();  // nobody is told: the map stays as it is
  result.tracking_ms = tracking.ms();
  times_.add("tracking", result.tracking_ms);
  return result;
}

void SlamSystem::Impl::finish() {
  KeyframePacket report = tracker_->make_report();
  if (next_keyframe_ > 0 && !localise_only_) mapping_->push(std::move(report), next_frame_);
  bool adjusted_last = !options_.final_ba;
  while (true) {
    if (const auto view = mapping_->drain()) take_view(*view);
    if (localise_only_ || next_keyframe_ == 0) return;
    loop_->offer(tracker_->shared_view(), next_frame_, false);
    auto corrections = loop_->take_due(std::numeric_limits<FrameIndex>::max(), true);
    if (corrections.empty() && loop_->idle()) {
      if (adjusted_last) return;
      adjusted_last = true;
      loop_->want_adjustment();
    }
    for (auto& correction : corrections) mapping_->push(std::move(correction), next_frame_);
  }
}

}  // namespace dkb
