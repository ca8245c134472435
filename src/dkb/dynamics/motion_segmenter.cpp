// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_segmenter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "dkb/features/vectorised.h"
#include "dkb/geometry/motion_model.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr float kTooNear = 0.45f;  // [m] taken for the depth of what is too near for the sensor
constexpr float kNearRange =
    0.55f;                       // [m] where depth is missing now, a surface seen nearer than this may still be there
constexpr size_t kMaxViews = 8;  // past views kept
constexpr size_t kViewsPerFrame = 4;   // of them compared with each frame, in turn
constexpr double kViewInterval = 0.2;  // [s] between views when they are taken; with age they thin out
constexpr double kViewAge = 15;        // [s] older views are dropped, so that a parked chair becomes part of the room
constexpr float kSlope = 1;            // share of a view's depth range over 3 x 3 cells added to the tolerance
constexpr double kLongAgo = 0.5;       // [s] after which the frame before no longer tells where who walked is now
constexpr double kSettle = 0.5;        // [s] agreement with a view counts in proportion to its age up to this
constexpr double kHoleMemory = 1;      // [s] the memory of what is too near for the sensor

// Weights of evidence beside that of an intrusion into space seen empty, which is 1.
constexpr float kThere = 0.1f;   // a surface that is where a view had it: still, but so is the inside of one that sways
constexpr float kState = 0.02f;  // what the cell was before
constexpr float kPrior = 0.015f;        // nothing moves until something says so
constexpr float kHolePrior = 0.02f;     // the same where depth is missing
constexpr float kFullEvidence = 0.05f;  // mean weight around a cell at which one frame says all it can

constexpr float kMaxScore = 3.0f, kMinScore = -1.0f;  // bounds of scores: a still cell is convinced sooner than a mover
constexpr float kStill = -0.3f;                       // below it nothing speaks for motion
constexpr int kCarryRadius = 2;  // [cells] a mover is sought around where it would be, were it still
constexpr int kSupport = 5;      // cells of 3 x 3 that must agree
constexpr double kWalk = 1.5;    // [m/s] people walk at their ease (1.3 to 1.5: Bohannon, Age and Ageing 1997)
// [m/s] The same along the line of sight, in the mean over all ways that they may go.
constexpr double kWalkInDepth = 2 / std::numbers::pi * kWalk;
constexpr size_t kBlockCells = 640;  // [cells] worked at together

template <class T>
std::unique_ptr<T> take_spare(std::unique_ptr<T>& spare) {
  return spare ? std::move(spare) : std::make_unique<T>();
}

// Visits the cells of `marks` of whose 3 x 3 at least kSupport are marked.
template <class Visit>
void for_supported(const Image<uint8_t>& marks, const Visit& visit) {
  for (int y = 1; y + 1 < marks.height(); ++y) {
    const std::array<const uint8_t*, 3> rows{marks.row(y - 1), marks.row(y), marks.row(y + 1)};
    for (int x = 1; x + 1 < marks.width(); ++x) {
      if (rows[1][x] == 0) continue;
      int support = 0;
      for (const uint8_t* row : rows) support += row[x - 1] + row[x] + row[x + 1];
      if (support >= kSupport) visit(x, y);
    }
  }
}

// Whether something `z` away, known to `tolerance`, stands in space that a cell saw empty, whose depths are `near` to
// `far` [m].
inline bool stands_before(float z, float tolerance, float near, float far, const SensorNoise& noise) {
  const float of_both = std::max(tolerance, static_cast<float>(noise.surface_tolerance(near)));
  return z + of_both + kSlope * (far - near) < near;
}

void clear(Image<float>& image, CellRange range) {
  std::fill_n(image.data() + range.first, range.count, 0.0f);
}

}  // namespace

MotionSegmenter::MotionSegmenter(const CameraModel& camera, const SensorNoise& noise, const MotionOptions& options,
                                 Simd simd)
    : camera_(camera),
      noise_(noise),
      options_(options),
      simd_(simd),
      rays_(camera, depth_cell(camera)),
      smoothing_(camera, noise, depth_cell(camera), simd),
      alignment_(noise, camera.fx, rays_) {
  const int width = rays_.width(), height = rays_.height();
  for (Image<float>* i : {&still_, &weighted_, &weights_}) *i = Image<float>(width, height);
  known_ = intruding_ = vacated_ = Image<uint8_t>(width, height);
  tolerance_.resize(kBlockCells), verdict_.resize(kBlockCells);
  for (auto* v : {&there_.nearest, &there_.farthest, &there_.depth, &there_.score}) v->resize(kBlockCells);
}

void MotionSegmenter::forget_views() {
  views_.clear();
  previous_.reset();
  last_.reset();
  guessing_ = false;
}

void MotionSegmenter::reset() {
  forget_views();
  current_.reset();
}

void MotionSegmenter::move_views(const Rigid3& new_from_old, double after) {
  const Rigid3 old_from_new = new_from_old.inverse();
  for (auto& view : views_)
    if (view->time > after) view->cam_from_world = view->cam_from_world * old_from_new;
  for (MotionDepthGrid* grid : {previous_.get(), current_.get()})
    if (grid != nullptr && grid->time > after) grid->cam_from_world = grid->cam_from_world * old_from_new;
  if (last_) last_->cam_from_world = last_->cam_from_world * old_from_new;
}

// Depth is taken at another time than colour, and a hand-held camera turns by a degree until then. The depth camera in
// the colour camera, while the motion that made `step` in so many seconds goes on.
Rigid3 MotionSegmenter::depth_cam_from_cam(const Rigid3& step, double seconds) const {
  const double later = current_->time - image_time_;
  if (!(seconds > 0) || seconds > kEvenMotion || std::abs(later) > kEvenMotion) return {};
  return rigid3_from_tangent(later / seconds * tangent_from_rigid3(step));
}

Rigid3 MotionSegmenter::depth_cam_from_cam(const Rigid3& cam_from_world) const {
  if (!last_) return {};
  return depth_cam_from_cam(cam_from_world * last_->cam_from_world.inverse(), image_time_ - last_->time);
}

void MotionSegmenter::observe(const RgbdImage& image, double depth_time, const Rigid3& cam_from_world_expected,
                              const Matrix6d& step_covariance) {
  if (image.depth.width() != camera_.width || image.depth.height() != camera_.height)
    throw InputError("motion segmentation: the depth image is " + std::to_string(image.depth.width()) + " x " +
                     std::to_string(image.depth.height()) + ", the camera " + std::to_string(camera_.width) + " x " +
                     std::to_string(camera_.height) + "; give images of the camera's size");
  image_time_ = image.timestamp;
  aligned_step_.reset();
  has_depth_ = has_depth(image.depth);
  if (!has_depth_) {
    if (current_) spare_ = std::move(current_);
    if (previous_) depth_from_colour_ = previous_->cam_from_world * cam_from_world_expected.inverse();
    return;
  }
  if (!current_) current_ = take_spare(spare_);
  current_->set_depth(image.depth, rays_, simd_);
  current_->time = depth_time;
  depth_from_colour_ = depth_cam_from_cam(cam_from_world_expected);
  current_->cam_from_world = depth_from_colour_ * cam_from_world_expected;
  if (previous_ && current_->time - previous_->time > kLongAgo) {
    keep_as_view(*previous_);
    spare_ = std::move(previous_);
  }
  find_pose(step_covariance);
  find_velocity();
  if (!is_placed(step_covariance)) {
    clear(current_->score, rays_.all_cells());
    clear(still_, rays_.all_cells());
    return;
  }
  choose_views();
  // Some cells through all steps before the next: what they read and write stays in the nearest cache.
  for (size_t first = 0; first < score().size(); first += kBlockCells) {
    const CellRange block{first, std::min(kBlockCells, score().size() - first)};
    find_tolerances(block);
    carry_scores(block);
    clear(still_, block);
    std::fill_n(intruding_.data() + block.first, block.count, uint8_t{0});
    for (const ChosenView& view : chosen_) compare(view, block);
  }
  find_vacated();
  smoothing_.set_surface(current_->depth);
  weigh();
  smoothing_.smooth(weighted_, weights_);
  update_scores();
}

// Of what is before the camera between the frame before and this one.
void MotionSegmenter::find_velocity() {
  current_->velocity.setZero();
  if (!previous_ || !(current_->time > previous_->time)) return;
  const Rigid3 step = current_->cam_from_world * previous_->cam_from_world.inverse();
  current_->velocity = tangent_from_rigid3(step) / (current_->time - previous_->time);
}

// The velocity does not last: what a hand changes it by between slow frames is more than the comparison forgives. The
// surfaces of the frame before tell where the camera is.
void MotionSegmenter::find_pose(const Matrix6d& step_covariance) {
  if (!previous_ || !(current_->time > previous_->time)) return;
  aligned_step_ =
      alignment_.align(*current_, *previous_, rays_,
                       {previous_->cam_from_world * current_->cam_from_world.inverse(), false, step_covariance});
  if (!aligned_step_) return;
  const Rigid3 step = aligned_step_->previous_from_current.inverse();
  const double seconds = current_->time - previous_->time;
  // Nothing told how the camera moved when the first image was taken: as it went on.
  if (previous_->velocity.isZero(0) && seconds <= kEvenMotion)
    previous_->cam_from_world =
        rigid3_from_tangent((previous_->time - last_->time) / seconds * tangent_from_rigid3(step)) *
        last_->cam_from_world;
  current_->cam_from_world = step * previous_->cam_from_world;
  depth_from_colour_ = depth_cam_from_cam(step, seconds);
  aligned_step_->previous_from_current =
      last_->cam_from_world * current_->cam_from_world.inverse() * depth_from_colour_;
}

// Whether the camera is known to be where it sees what views of before saw, to a cell of them: by its surfaces, or by
// what was expected of a step that was no leap. Points 1 m away are nearer than most.
bool MotionSegmenter::is_placed(const Matrix6d& step_covariance) const {
  if (aligned_step_) return true;
  const Vector6d sd = step_covariance.diagonal().cwiseSqrt();
  return camera_.fx * (sd.head<3>().maxCoeff() + sd.tail<3>().maxCoeff()) < rays_.cell();
}

// Not all views speak in each frame: they take turns.
void MotionSegmenter::choose_views() {
  std::erase_if(views_, [this](const auto& view) { return current_->time - view->time > kViewAge; });
  const Rigid3 world_from_cam = current_->cam_from_world.inverse();
  const auto first =
      std::find_if(views_.begin(), views_.end(), [&](const auto& view) { return !guessing_ || view->time > told_; });
  const auto count = static_cast<size_t>(views_.end() - first), chosen = std::min(count, kViewsPerFrame);
  chosen_.clear();
  for (size_t i = 0; i < chosen; ++i) {
    MotionView& view = *first[static_cast<std::ptrdiff_t>((turn_ + i * count / chosen) % count)];
    const auto trust = static_cast<float>(std::clamp((current_->time - view.time) / kSettle, 0.0, 1.0));
    chosen_.push_back({&view, view.cam_from_world * world_from_cam, trust});
  }
  ++turn_;
}

void MotionSegmenter::find_tolerances(CellRange block) {
  run_vectorised(simd_, [count = block.count, depth = current_->depth.data() + block.first,
                         tolerance = tolerance_.data(), noise = noise_]() DKB_KERNEL_BODY {
    for (size_t i = 0; i < count; ++i) tolerance[i] = static_cast<float>(noise.surface_tolerance(depth[i]));
  });
}

// Each cell takes over the score of the same surface in the frame before.
void MotionSegmenter::carry_scores(CellRange block) {
  if (!previous_) {
    std::fill_n(known_.data() + block.first, block.count, uint8_t{0});
    return clear(current_->score, block);
  }
  const Rigid3 before_from_now = previous_->cam_from_world * current_->cam_from_world.inverse();
  rays_.project(current_->depth, kTooNear, before_from_now, block, projection_, simd_, readout_of(current_->velocity),
                readout_of(previous_->velocity));
  const double interval = std::max(0.0, current_->time - previous_->time);
  const auto walked = static_cast<float>(kWalkInDepth * interval);
  const auto keep = static_cast<float>(std::exp(-interval / options_.memory));
  const auto keep_hole = static_cast<float>(std::exp(-interval / kHoleMemory));
  const Image<float>& before = previous_->depth;
  const float* const tolerances = tolerance_.data();
  float* const scores = current_->score.data() + block.first;
  uint8_t* const knowns = known_.data() + block.first;
  run_vectorised(
      simd_, [=, count = block.count, cells = projection_.cell.data(), there = projection_.depth.data(),
              depth = current_->depth.data() + block.first, depth_before = before.data(),
              score_before = previous_->score.data(), verdict = verdict_.data(), near = kNearRange]() DKB_KERNEL_BODY {
        DKB_INDEPENDENT_STEPS
        for (size_t i = 0; i < count; ++i) {
          const int32_t cell = cells[i], at = cell < 0 ? 0 : cell;
          const float then = depth_before[at], carried = score_before[at];
          const bool seen = cell >= 0, hole = !(depth[i] > 0);
          const bool too_near = seen & hole & (then < near);
          const bool same = seen & !hole & (then > 0) & (std::abs(then - there[i]) < tolerances[i] + walked);
          const float score_if_near = too_near ? keep_hole * std::max(0.0f, carried) : 0.0f;
          scores[i] = same ? keep * carried : score_if_near;
          knowns[i] = (too_near | same) ? 1 : 0;
          verdict[i] = (seen & !hole & !same) ? 1 : 0;
        }
      });
  for (size_t i = 0; i < block.count; ++i) {
    if (verdict_[i] == 0) continue;
    const int at = projection_.cell[i];
    const float depth_there = projection_.depth[i];
    float bound = tolerances[i] + walked;
    // It has moved: the cell around that fits best in depth.
    const int x = at % before.width(), y = at / before.width();
    for (int v = std::max(0, y - kCarryRadius); v <= std::min(before.height() - 1, y + kCarryRadius); ++v)
      for (int u = std::max(0, x - kCarryRadius); u <= std::min(before.width() - 1, x + kCarryRadius); ++u) {
        const float difference = std::abs(before(u, v) - depth_there);
        if (!(before(u, v) > 0) || difference >= bound) continue;
        bound = difference;
        scores[i] = keep * previous_->score(u, v);
        knowns[i] = 1;
      }
  }
}

// What one view says of each cell: its surface stands in space that the view saw empty, or it was there already.
void MotionSegmenter::compare(const ChosenView& chosen, CellRange block) {
  rays_.project(current_->depth, kTooNear, chosen.there_from_here, block, projection_, simd_,
                readout_of(current_->velocity), readout_of(chosen.view->velocity));
  const std::vector<int32_t>& cells = projection_.cell;
  const std::vector<MotionView::Cell>& view = chosen.view->cells;
  // Views come from far down the memory: some way ahead, they are asked for early.
  const size_t last = view.size() - 1;
  for (size_t i = 0; i < block.count; ++i) {
    const auto at = static_cast<size_t>(std::max(cells[i], 0));
    const MotionView::Cell& cell = view[at];
    there_.nearest[i] = cell.nearest, there_.farthest[i] = cell.farthest;
    there_.depth[i] = cell.depth, there_.score[i] = cell.score;
    if (i % 4 == 0) __builtin_prefetch(view.data() + std::min(at + kBlockCells, last));
  }
  run_vectorised(
      simd_, [count = block.count, cell = cells.data(), depth_there = projection_.depth.data(),
              depth = current_->depth.data() + block.first, tolerance = tolerance_.data(),
              nearest = there_.nearest.data(), farthest = there_.farthest.data(), depth_then = there_.depth.data(),
              score_then = there_.score.data(), intruding = intruding_.data() + block.first,
              still = still_.data() + block.first, weight = chosen.trust * kThere, noise = noise_]() DKB_KERNEL_BODY {
        DKB_INDEPENDENT_STEPS
        for (size_t i = 0; i < count; ++i) {
          const float z = depth_there[i], near = nearest[i], far = farthest[i], tolerated = tolerance[i];
          const bool known = (cell[i] >= 0) & (depth[i] > 0) & (far > 0);
          const bool before = z + tolerated < near, same = !before & (z < far + tolerated);
          intruding[i] |= (known & (depth_then[i] > 0) & stands_before(z, tolerated, near, far, noise)) ? 1 : 0;
          still[i] += (known & same & (score_then[i] < kMayMove)) ? weight : 0.0f;
        }
      });
}

// Who comes from where the camera has not looked yet stands in no space seen empty. But what was behind him comes to
// light where the frame before had a surface: whatever is as far away beside it, no farther than one walks in the time
// between, is that surface gone on.
void MotionSegmenter::find_vacated() {
  if (!previous_) return;
  const Image<float>& depth = current_->depth;
  const int width = depth.width(), height = depth.height();
  rays_.project(previous_->depth, kTooNear, current_->cam_from_world * previous_->cam_from_world.inverse(),
                rays_.all_cells(), projection_, simd_, readout_of(previous_->velocity), readout_of(current_->velocity));
  for (size_t first = 0; first < vacated_.size(); first += kBlockCells) {
    const size_t count = std::min(kBlockCells, vacated_.size() - first);
    const int32_t* const cells = projection_.cell.data() + first;
    for (size_t i = 0; i < count; ++i)
      there_.nearest[i] = current_->nearest.data()[static_cast<size_t>(std::max(cells[i], 0))];
    run_vectorised(
        simd_, [count, cells, before = previous_->depth.data() + first, z = projection_.depth.data() + first,
                nearest = there_.nearest.data(), vacated = vacated_.data() + first, noise = noise_]() DKB_KERNEL_BODY {
          for (size_t i = 0; i < count; ++i) {
            const float tolerance = static_cast<float>(noise.surface_tolerance(z[i]));
            vacated[i] = ((cells[i] >= 0) & (before[i] > 0) & (z[i] + tolerance < nearest[i])) ? 1 : 0;
          }
        });
  }
  // Few are left for the whole margin, which asks for more than one gathers for all.
  for (size_t i = 0; i < vacated_.size(); ++i) {
    if (vacated_.data()[i] == 0) continue;
    const auto at = static_cast<size_t>(projection_.cell[i]);
    const float z = projection_.depth[i], near = current_->nearest.data()[at], far = current_->farthest.data()[at];
    const auto tolerance = static_cast<float>(noise_.surface_tolerance(z));
    vacated_.data()[i] = far > 0 && stands_before(z, tolerance, near, far, noise_) ? 1 : 0;
  }
  const double interval = std::max(0.0, current_->time - previous_->time);
  const auto walked = static_cast<float>(kWalkInDepth * interval);
  const double reach = kWalk * interval * camera_.fx / rays_.cell();  // [cells] at 1 m
  for_supported(vacated_, [&](int x, int y) {
    const size_t i = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
    const int at = projection_.cell[i], u0 = at % width, v0 = at / width;
    const float z = projection_.depth[i], bound = static_cast<float>(noise_.surface_tolerance(z)) + walked;
    const int radius = 1 + static_cast<int>(std::clamp(reach / z, 0.0, static_cast<double>(width)));
    for (int v = std::max(0, v0 - radius); v <= std::min(height - 1, v0 + radius); ++v)
      for (int u = std::max(0, u0 - radius); u <= std::min(width - 1, u0 + radius); ++u)
        if (depth(u, v) > 0 && std::abs(depth(u, v) - z) < bound) intruding_(u, v) = 1;
  });
}

void MotionSegmenter::weigh() {
  const Image<float>& depth = current_->depth;
  const auto weigh_cell = [](bool moves, float still, float score, float z, float& weighted,
                             float& weights) DKB_KERNEL_BODY {
    const float comes = moves ? 1.0f : 0.0f, stands = moves ? 0.0f : std::min(1.0f, still);
    const float state = std::max(-1.0f, std::min(score, 1.0f)), weight = kState * std::abs(state);
    const float doubt = z > 0 ? kPrior : kHolePrior;
    weighted = comes - stands + weight * state - doubt;
    weights = comes + stands + weight + doubt;
  };
  run_vectorised(
      simd_, [weigh_cell, count = depth.size(), z = depth.data(), still = still_.data(), score = current_->score.data(),
              weighted = weighted_.data(), weights = weights_.data()]() DKB_KERNEL_BODY {
        for (size_t i = 0; i < count; ++i) weigh_cell(false, still[i], score[i], z[i], weighted[i], weights[i]);
      });
  for_supported(intruding_, [&](int x, int y) {
    weigh_cell(true, still_(x, y), current_->score(x, y), depth(x, y), weighted_(x, y), weights_(x, y));
  });
}

void MotionSegmenter::update_scores() {
  const float gain = 1.0f / kFullEvidence;
  run_vectorised(simd_, [gain, count = weights_.size(), weights = weights_.data(), weighted = weighted_.data(),
                         known = known_.data(), score = current_->score.data()]() DKB_KERNEL_BODY {
    for (size_t i = 0; i < count; ++i) {
      const float weight = weights[i], mean = weighted[i] / weight;
      const float before = known[i] != 0 ? score[i] : mean;  // what is new is what it hangs together with
      const float now = std::clamp(before + mean * std::min(1.0f, weight * gain), kMinScore, kMaxScore);
      score[i] = weight > 0 ? now : score[i];
    }
  });
}

// Scores belong to the depth image; the mask to the colour image, which sees the same surfaces a little displaced.
MoverMask MotionSegmenter::mask() {
  MoverMask result;
  result.cell = rays_.cell();
  result.cells = Image<uint8_t>(rays_.width(), rays_.height());
  const MotionDepthGrid* const known = has_depth_ ? current_.get() : previous_.get();
  if (known == nullptr || image_time_ - known->time > kLongAgo) return result;
  const auto threshold = static_cast<float>(options_.threshold);
  rays_.project(known->depth, kTooNear, depth_from_colour_, rays_.all_cells(), projection_, simd_);
  run_vectorised(simd_, [threshold, count = result.cells.size(), cells = projection_.cell.data(),
                         score = known->score.data(), marked = result.cells.data()]() DKB_KERNEL_BODY {
    DKB_INDEPENDENT_STEPS
    for (size_t i = 0; i < count; ++i) {
      const int32_t cell = cells[i];
      const float there = score[cell < 0 ? 0 : cell];
      marked[i] = ((cell >= 0) & (there > threshold)) ? 255 : 0;
    }
  });
  return result;
}

StillCells MotionSegmenter::still() const {
  StillCells still{rays_.cell(), {}};
  if (!has_depth_) return still;
  const Image<float>& scores = score();
  still.kinds = Image<uint8_t>(scores.width(), scores.height());
  run_vectorised(simd_, [n = scores.size(), score = scores.data(), there = still_.data(),
                         kind = still.kinds.data()]() DKB_KERNEL_BODY {
    DKB_INDEPENDENT_STEPS
    for (size_t i = 0; i < n; ++i) {
      const bool stands = score[i] < kStill, seen = there[i] >= kThere;
      kind[i] = stands ? (seen ? StillCells::witnessed : StillCells::unrefuted) : StillCells::unknown;
    }
  });
  return still;
}

void MotionSegmenter::take_bodies(const MoverMask& bodies) {
  if (!current_) return;
  Image<float>& score = current_->score;
  const std::vector<int> columns = rows_at_middle(bodies.cells.width(), bodies.cell, rays_.cell());
  for (int y = 0; y < bodies.cells.height(); ++y) {
    const uint8_t* const body = bodies.cells.row(y);
    const int v = row_at_middle(y, bodies.cell, rays_.cell());
    for (size_t x = 0; x < columns.size(); ++x)
      if (body[x] != 0 && score.contains(columns[x], v))
        score(columns[x], v) = std::max(score(columns[x], v), kMayMove);
  }
}

void MotionSegmenter::take_second_motion(std::span<const MatchMotion> matches) {
  if (!current_ || matches.empty()) return;
  Image<float>& score = current_->score;
  const MoverMask moving = moving_cells(current_->depth, rays_.cell(), matches);
  for (size_t i = 0; i < score.size(); ++i)
    if (moving.cells.data()[i] != 0) score.data()[i] = std::min(std::max(score.data()[i], 0.0f) + 1, kMaxScore);
}

void MotionSegmenter::commit(const std::optional<Rigid3>& cam_from_world, bool guessed) {
  if (!current_ && !previous_) return;
  if (!cam_from_world) {
    reset();
    return;
  }
  if (!current_) {
    last_ = Stamped{image_time_, *cam_from_world};
    guessing_ = guessed;
    if (!guessed) told_ = previous_->time;
    return;
  }
  current_->cam_from_world = depth_cam_from_cam(*cam_from_world) * *cam_from_world;
  find_velocity();
  last_ = Stamped{image_time_, *cam_from_world};
  guessing_ = guessed;
  if (!guessed) told_ = current_->time;
  if (previous_) {
    keep_as_view(*previous_);
    spare_ = std::move(previous_);
  }
  previous_ = std::move(current_);
}

// The newest views lie `view_interval` apart; of more than `views`, the one goes whose loss leaves the smallest gap in
// proportion to its age.
void MotionSegmenter::keep_as_view(const MotionDepthGrid& grid) {
  const double interval = views_.size() == 1 ? 0.3 * kViewInterval : kViewInterval;
  if (!views_.empty() && grid.time - views_.back()->time < interval) return;
  auto view = take_spare(spare_view_);
  view->set(grid);
  views_.push_back(std::move(view));
  if (views_.size() <= kMaxViews) return;
  const double now = views_.back()->time;
  size_t drop = 0;
  double smallest = 0;
  for (size_t i = 1; i + 1 < views_.size(); ++i) {
    const double gap = (views_[i + 1]->time - views_[i - 1]->time) / (now - views_[i]->time + kViewInterval);
    if (drop == 0 || gap < smallest) {
      smallest = gap;
      drop = i;
    }
  }
  spare_view_ = std::move(views_[drop]);
  views_.erase(views_.begin() + static_cast<std::ptrdiff_t>(drop));
}

}  // namespace dkb
