// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>

#include "dkb/keyframes/user_policy.h"
#include "dkb/slam/pipeline.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr int kFeatureShare = 2;         // by which the features are cut in a real-time run that is late
constexpr double kUsualFeatures = 1000;  // of a frame, that the numbers of keyframe rules are meant for

std::unique_ptr<KeyframeDecider> make_decider(const PipelineContext& context) {
  if (context.policy) return std::make_unique<UserKeyframeDecider>(context.policy);
  if (context.options.keyframe_policy == KeyframePolicyKind::adaptive)
    return std::make_unique<AdaptiveKeyframePolicy>(context.options.adaptive_keyframes, context.camera.width,
                                                    context.camera.height);
  return std::make_unique<BaselineKeyframePolicy>();
}

Optics optics_of(const PipelineContext& context) {
  const SlamOptions& o = context.options;
  return {context.camera, o.noise, o.features.scale, o.features.levels};
}

}  // namespace

Pipeline::Pipeline(const PipelineContext& context, RunRecord& record, Map map)
    : context_(context),
      options_(context.options),
      record_(record),
      undistort_(context.camera),
      extractor_(options_.features, best_simd(), options_.pipeline.threaded),
      planes_(context.camera, options_.noise),
      tracker_(optics_of(context), options_.tracking, options_.seed),
      merge_hold_(optics_of(context), options_.seed),
      decider_(make_decider(context)),
      scenes_(context.camera, options_.noise, options_.dynamics, context.detectors, options_.pipeline.threaded,
              options_.pipeline.realtime),
      timing_(optics_of(context), options_.estimate_timing && options_.depth.model_rolling_shutter,
              options_.estimate_timing && options_.depth.model_time_offset),
      movers_(context.camera, options_.noise, options_.pipeline.threaded),
      odometry_(options_.base_from_cam),
      rate_(context.camera.fps),
      stamp_doubt_(context.camera.fps),
      next_keyframe_(map.keyframe_count()),
      mapping_(LocalMapper(optics_of(context), options_.mapping, map), options_.pipeline.threaded),
      loop_(optics_of(context), options_.loop_closing, options_.mapping.ba, options_.seed, options_.pipeline.threaded) {
  if (context_.camera.mask) extractor_.leave_out(*context_.camera.mask);
  tracker_.set_start(options_.base_from_cam.inverse());
  loop_.start_at(next_keyframe_);
  last_keyframe_ = last_keyframe_of(map, next_keyframe_ - 1);
  if (next_keyframe_ > 0) {
    tracker_.take_view(map.snapshot());
    tracker_.reset_motion();
  }
  if (options_.dense_map) {
    DenseOptions dense = options_.dense;
    if (!options_.pipeline.threaded) dense.threads = 1;
    dense_.emplace(context.camera, options_.noise, dense);
  }
  if (options_.pipeline.realtime) load_.emplace();
  record_.set_map(tracker_.map());
  collect_times();
}

void Pipeline::check(const Frame& frame) const {
  const std::string name = "frame " + std::to_string(next_frame_);
  if (frame.empty()) throw InputError(name + ": it has no images");
  const Camera& camera = context_.camera;
  const RgbdImage& image = *frame.image();
  const bool fits = image.grey.width() == camera.width && image.grey.height() == camera.height &&
                    image.depth.width() == camera.width && image.depth.height() == camera.height;
  if (!fits)
    throw InputError(name + ": its images are not of the camera's size, " + std::to_string(camera.width) + " x " +
                     std::to_string(camera.height));
  if (next_frame_ > 0 && frame.stamp_ns() <= last_stamp_ns_)
    throw InputError(name + ": its stamp " + stamp_text(frame.stamp_ns()) + " is not after the one before it (" +
                     stamp_text(last_stamp_ns_) + "); call reset() or load_map() when the clock was set back");
}

void Pipeline::shed_load() {
  load_->begin(last_stamp_ns_, steady_ns());
  const LoadShedding::Level level = load_->level();
  scenes_.rest_detector(level >= LoadShedding::kDetection);
  if (std::string warning = load_->take_warning(); !warning.empty()) note(Event::Kind::warning, std::move(warning));
}

// Returns the time that it took [ms].
double Pipeline::take_due_map(bool wait) {
  const Stopwatch watch;
  const auto view = mapping_.take_due(next_frame_, wait);
  if (view) take_view(*view);
  if (!localize_only_) {
    const bool has_time = !load_ || load_->level() < LoadShedding::kLoops;
    if (view && has_time && mapping_.outstanding_corrections() == 0)
      loop_.offer(*view, next_frame_, rate_, options_.pipeline.realtime);
    correct(loop_.take_due(next_frame_, wait), mapping_due());
  }
  const double ms = watch.ms();
  record_.add_time("wait_mapper", ms);
  return ms;
}

void Pipeline::take_view(const MapView& view) {
  const Rigid3 moved = tracker_.take_view(view);
  odometry_.move_world(moved);
  movers_.rebase(moved);
  scenes_.move_world(moved);
  map_number_ = {};
  record_.set_map(tracker_.map());
}

int Pipeline::map_number(KeyframeId reference) {
  const TrackingMap& map = tracker_.map();
  if (map_number_.reference != reference)
    map_number_ = {reference, dkb::map_number(map.view().roots(), map.root(reference))};
  return map_number_.number;
}

void Pipeline::correct(std::vector<std::shared_ptr<const MapCorrection>> corrections, FrameIndex due) {
  for (auto& correction : corrections) {
    if (correction->kind == MapCorrection::Kind::merge) {
      merge_hold_.hold(std::move(correction), tracker_.map().view());
      continue;
    }
    if (correction->kind == MapCorrection::Kind::loop) merge_hold_.drop();
    apply(std::move(correction), due);
  }
}

void Pipeline::apply(std::shared_ptr<const MapCorrection> correction, FrameIndex due) {
  if (correction->kind != MapCorrection::Kind::adjustment) {
    const bool merge = correction->kind == MapCorrection::Kind::merge;
    const LoopInfo loop{correction->near_side.front(), correction->far_side.front(), merge};
    record_.add(loop);
    note(merge ? Event::Kind::merge : Event::Kind::loop,
         "keyframe " + std::to_string(loop.keyframe) + " shows the place of " + std::to_string(loop.earlier_keyframe),
         loop.keyframe);
  }
  mapping_.push(std::move(correction), due);
}

// Whether the frame shows what a merge that waits says it must.
void Pipeline::weigh_merge(const TrackedFrame& tracked, PointAppearance& appearance) {
  if (!merge_hold_.waits() || !tracked.tracked() || tracked.starts_map) return;
  const TrackingMap& map = tracker_.map();
  auto merge = merge_hold_.look(map.view(), map.root(tracked.reference), tracked, &appearance);
  if (!merge) return;
  loop_.merged(*merge);
  apply(std::move(merge), mapping_due());
}

int Pipeline::features_wanted() const {
  const int count = options_.features.count;
  return late_for_features() ? (count + kFeatureShare - 1) / kFeatureShare : count;
}

ExtractedFrame Pipeline::extract(const Frame& frame) {
  const Stopwatch watch;
  const GreyImage& grey = frame.image()->grey;
  // When movers took most of the last frame's features, the rest of the image gets its half now.
  const bool crowded = crowded_share_ > 0.5 && !last_mask_.empty();
  extractor_.set_count(features_wanted());
  ExtractedFrame extracted{
      next_frame_, frame,
      crowded ? extractor_.extract(grey, last_mask_.cells, last_mask_.cell) : extractor_.extract(grey)};
  record_.add_time("features", watch.ms());
  return extracted;
}

Expectation Pipeline::expect(const Frame& frame) const {
  Expectation expected;
  expected.depth_time = frame.image()->depth_time(timing_.camera());
  const auto& last = tracker_.last_frame();
  if (!last) return expected;
  expected.step = tracker_.expected_step(frame.image()->timestamp, frame.prior() ? &*frame.prior() : nullptr);
  expected.cam_from_world = expected.current_from_previous() * last->cam_from_world;
  if (scenes_.keyframes_looked_at() == 0) return expected;
  const Map& map = tracker_.map().view();
  for (KeyframeId id : map.newest_beside(last->reference, scenes_.keyframes_looked_at())) {
    const Keyframe& k = *map.keyframe(id);
    const Rigid3 cam_from_keyframe = expected.cam_from_world * k.cam_from_world.inverse();
    for (const Keypoint& p : k.features->keypoints)
      if (p.depth > 0)
        expected.keyframe_points_in_camera.push_back(cam_from_keyframe *
                                                     context_.camera.unproject(p.pixel.cast<double>(), p.depth));
  }
  return expected;
}

// Detections that came after their keyframe: what it made on movers goes.
void Pipeline::retract_late(const std::vector<LateMask>& masks) {
  for (const LateMask& late : masks) {
    if (dense_) dense_->remove_movers(late.frame, late.mask);
    for (const RecentKeyframe& k : recent_keyframes_) {
      if (k.frame != late.frame) continue;
      std::vector<PointId> points;
      for (size_t f = 0; f < k.features->size(); ++f) {
        const Keypoint& p = k.features->keypoints[f];
        if (late.mask.at(p.image_pixel.x(), p.image_pixel.y()))
          points.push_back(make_point_id(k.id, static_cast<int>(f)));
      }
      tracker_.retract(points);
    }
  }
}

// The map may have moved since the camera's place was expected.
void Pipeline::look_for_movers(const Scene& scene, const Expectation& expected) {
  if (options_.dynamics.filter != FilterKind::standard) return;
  const std::optional<MotionPrior>& step = scene.step ? scene.step : expected.step;
  std::optional<Rigid3> world_from_cam;
  if (const auto& last = tracker_.last_frame(); last && step)
    world_from_cam = last->cam_from_world.inverse() * step->previous_from_current;
  movers_.begin(scene, world_from_cam);
}

TrackedFrame Pipeline::track(const Scene& scene, const UsableFeatures& usable) {
  const Frame& frame = scene.extracted.frame;
  const RgbdImage& image = *frame.image();
  ExtractedFeatures features(usable.orb, image, timing_.camera(), undistort_, options_.noise, options_.depth);
  features.motion = usable.motion;
  ImageAppearance appearance(image.depth, context_.camera, options_.noise, extractor_.pyramid(), extractor_.brief());
  std::optional<ExtractedFeatures> start;
  if (start_)
    start.emplace(start_->usable.orb, start_->scene.extracted.image(), timing_.camera(), undistort_, options_.noise,
                  options_.depth);
  std::optional<PosePrediction> before;  // where the images showed the camera in the frame before
  if (const auto& last = tracker_.last_frame(); last && last->tracked() && last->index + 1 == next_frame_)
    before = PosePrediction{last->cam_from_world, last->covariance};
  TrackedFrame tracked = tracker_.track({.index = next_frame_,
                                         .timestamp = image.timestamp,
                                         .features = features,
                                         .appearance = &appearance,
                                         .prior = frame.prior() ? &*frame.prior() : nullptr,
                                         .step = scene.step ? &*scene.step : nullptr,
                                         .start = start ? &*start : nullptr,
                                         .movers = scenes_.compares_depth(),
                                         .may_start_map = may_make_keyframes()});
  if (start_) push_start(&tracked);
  weigh_merge(tracked, appearance);
  if (!tracked.tracked()) return tracked;
  if (before && !tracked.starts_map) {  // one that does stands where the prior says
    const auto& seen = tracked.by_observations;
    std::string doubt =
        priors_.add({before->cam_from_world * (seen ? seen->cam_from_world : tracked.cam_from_world).inverse(), false,
                     before->covariance + (seen ? inverse(seen->information) : tracked.covariance)});
    if (!doubt.empty()) note(Event::Kind::warning, std::move(doubt));
  }
  if (!timing_.known()) timing_.add(tracked, image.depth, tracker_.velocity(), tracker_.positions(tracked.points));
  return tracked;
}

void Pipeline::follow_motion(const Scene& scene) {
  if (!since_keyframe_) return;
  if (scene.step)
    since_keyframe_->since = joined(since_keyframe_->since, *scene.step);
  else
    since_keyframe_.reset();
}

// Map points that stand where a mover is, at the mover's depth, lose trust; those that fit the still world regain it.
void Pipeline::weigh_evidence(const Scene& scene, const TrackedFrame& tracked) {
  // A map that must not change keeps its points: nothing would come in their place.
  if (!tracked.tracked() || localize_only_) return;
  if (scene.mask.empty() && !evidence_.suspects()) {
    evidence_.weigh(tracked.timestamp, {}, {});  // the next look lasts since this frame
    return;
  }
  std::vector<PointId> matched, on_mover;
  matched.reserve(tracked.points.size());
  for (PointId p : tracked.points)
    if (p != kNoPoint) matched.push_back(p);
  std::sort(matched.begin(), matched.end());
  const DepthImage& depth = scene.extracted.image().depth;
  for (const PointInView& point : tracker_.points_in_view()) {
    const Eigen::Vector2f at = point.image_pixel.cast<float>();
    if (!scene.mask.at(at.x(), at.y())) continue;
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (!depth.contains(x, y) || !(depth(x, y) > 0)) continue;
    if (std::abs(depth(x, y) - point.depth) <= options_.noise.point_tolerance(point.depth) &&
        !std::binary_search(matched.begin(), matched.end(), point.id))
      on_mover.push_back(point.id);
  }
  evidence_.keep([this](PointId id) { return tracker_.position(id).has_value(); });
  tracker_.retract(evidence_.weigh(tracked.timestamp, matched, on_mover));
}

Pipeline::LastKeyframe Pipeline::last_keyframe_of(const Map& map, KeyframeId id) {
  const Keyframe* k = map.keyframe(id);
  if (k == nullptr) return {id, 0, 0};
  return {id, k->frame, ns_from_seconds(k->timestamp)};
}

// A keyframe without depth makes no points. Where every second frame has none, one that has is not far.
bool Pipeline::waits_for_depth(const TrackedFrame& tracked) {
  if (tracked.with_depth > 0) last_depth_time_ = tracked.timestamp;
  return tracked.with_depth == 0 && last_depth_time_ && tracked.timestamp - *last_depth_time_ <= kEvenMotion;
}

KeyframeDecision Pipeline::decide(const Scene& scene, const TrackedFrame& tracked) {
  if (!tracked.tracked()) return {};
  if (tracked.state == TrackingState::relocalised) {
    last_relocalisation_ = tracked.index;
    // One that mapping has not answered for yet is among the newest anyway.
    if (tracker_.map().view().keyframe(tracked.reference) != nullptr)
      last_keyframe_ = last_keyframe_of(tracker_.map().view(), tracked.reference);
    // The clock of the session that made it may be another one.
    if (last_keyframe_.frame < 0) last_keyframe_.stamp_ns = scene.extracted.frame.stamp_ns();
  }
  const Stopwatch watch;
  KeyframeDecision decision;
  if (tracked.starts_map) {
    decision = {true, KeyframeRule::first, "the map starts here"};
  } else if (localize_only_) {
    decision = {false, KeyframeRule::none, "the map is not changed"};
  } else if (!may_make_keyframes()) {
    decision = {false, KeyframeRule::none, "the map is full"};
  } else if (waits_for_depth(tracked)) {
    decision = {false, KeyframeRule::none, "it has no depth, and one just before it had"};
  } else {
    KeyframeContext c;
    c.frame = tracked.index;
    c.stamp_ns = scene.extracted.frame.stamp_ns();
    c.last_keyframe_frame = last_keyframe_.frame;
    c.last_keyframe_stamp_ns = last_keyframe_.stamp_ns;
    c.last_relocalisation_frame = last_relocalisation_;
    c.last_keyframe = last_keyframe_.id;
    c.mapper_idle = mapping_.outstanding() == 0;
    // A user's rule is told the plain numbers.
    const auto as_usual = [this](int count, int of) {
      return context_.policy ? count : static_cast<int>(std::lround(kUsualFeatures * count / of));
    };
    const int wanted = features_wanted();
    int tracked_close = 0, creatable_close = 0;
    for (size_t f = 0; f < tracked.points.size(); ++f) {
      const float z = tracked.features->keypoints[f].depth;
      if (!(z > 0) || z > options_.tracking.close_depth) continue;
      if (tracked.points[f] != kNoPoint)
        ++tracked_close;
      else if (!tracked.outlier[f])
        ++creatable_close;
    }
    c.tracked_points = as_usual(tracked.inliers, wanted);
    c.tracked_close_points = as_usual(tracked_close, wanted);
    c.creatable_close_points = as_usual(creatable_close, wanted);
    c.reference_points = as_usual(tracker_.reference_point_count(tracked.reference), options_.features.count);
    c.cam_from_world = tracked.cam_from_world;
    c.last_keyframe_cam_from_world = tracker_.map().cam_from_world(c.last_keyframe);
    c.points = &tracked.points;
    c.features = tracked.features.get();
    c.explain = explain_keyframes_;
    if (context_.policy) c.positions = tracker_.positions(tracked.points);
    decision = decider_->decide(c, tracker_.map().view());
    record_.add(decision.tests);
    if (options_.pipeline.realtime && static_cast<int>(mapping_.unfinished()) >= options_.pipeline.mapper_queue) {
      decision.insert = false;
      decision.rule = KeyframeRule::none;
      decision.explanation = "mapping has enough to do; " + decision.explanation;
    }
  }
  record_.add_time("keyframe_decision", watch.ms());
  if (decision.insert) record_.add(decision.rule);
  return decision;
}

std::shared_ptr<const PlaneView> Pipeline::find_planes(const Scene& scene) {
  const Stopwatch watch;
  const RgbdImage& image = scene.extracted.image();
  Rigid3 cam_from_depth_cam;
  if (options_.depth.model_time_offset)
    cam_from_depth_cam =
        rigid3_from_tangent(tracker_.velocity() * (image.timestamp - image.depth_time(timing_.camera())));
  auto planes = std::make_shared<const PlaneView>(planes_.find(image.depth, scene.mask, cam_from_depth_cam));
  record_.add_time("planes", watch.ms());
  return planes;
}

// `next`: the frame after it; may be null.
void Pipeline::push_start(const TrackedFrame* next) {
  MapStart start = std::move(*start_);
  start_.reset();
  if (next != nullptr && next->start_features) tracker_.remake(*next, start.packet);
  if (options_.mapping.ba.planes) start.packet.planes = find_planes(start.scene);
  mapping_.push(std::move(start.packet), mapping_due());
}

void Pipeline::insert_keyframe(const Scene& scene, const UsableFeatures& usable, TrackedFrame& tracked) {
  const KeyframeId id = next_keyframe_++;
  if (!may_make_keyframes())
    note(Event::Kind::warning, "the map is full, " + std::to_string(next_keyframe_) +
                                   " keyframes were made: tracking goes on in it; save it, and begin a new one");
  last_keyframe_ = {id, tracked.index, scene.extracted.frame.stamp_ns()};
  KeyframePacket packet = tracker_.make_keyframe(id, tracked);
  if (since_keyframe_) {
    packet.motion = std::make_shared<const KeyframeMotion>(*since_keyframe_);
  } else if (tracked.starts_map && tracked.predicted && packet.reference != kNoKeyframe) {
    // No image tells how the map hangs on the one before it: the prediction does, as well as it knows.
    const MotionPrior since{packet.cam_from_reference.inverse(), false, tracked.covariance};
    packet.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{packet.reference, since});
  }
  if (options_.mapping.ba.planes && !tracked.starts_map) packet.planes = find_planes(scene);
  since_keyframe_ = KeyframeMotion{id, {{}, false, Matrix6d::Zero()}};
  tracked.makes_point.assign(tracked.points.size(), 0);
  for (const ProvisionalPoint& p : packet.new_points) tracked.makes_point[static_cast<size_t>(birth_feature(p.id))] = 1;
  recent_keyframes_.push_back({tracked.index, id, tracked.features});
  while (recent_keyframes_.front().frame < tracked.index - 2 * scenes_.memory()) recent_keyframes_.pop_front();
  if (tracked.starts_map)
    start_ = MapStart{scene, usable, std::move(packet)};
  else
    mapping_.push(std::move(packet), mapping_due());
  tracked.reference = id;
  tracked.cam_from_reference = {};
  if (dense_) {
    const Stopwatch watch;
    // People who stand still are fit to track by, but no part of the map.
    MoverMask movers = scene.mask;
    const RgbdImage& image = scene.extracted.image();
    unite(movers, silhouettes(image.depth, scene.boxes, context_.camera, options_.noise).mask, image.depth.width(),
          image.depth.height());
    dense_->add_keyframe(tracked.index, image, image.depth_time(timing_.camera()), movers);
    record_.add_time("dense_keyframe", watch.ms());
  }
  record_.set_map(tracker_.map());  // this frame hangs on the new keyframe
}

}  // namespace dkb
