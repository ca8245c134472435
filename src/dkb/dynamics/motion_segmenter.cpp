// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_segmenter.h"

#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

struct Transform {
  float r[9], t[3];
  explicit Transform(const Rigid3& m) {
    const Eigen::Matrix3d a = m.matrix3();
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) r[3 * i + k] = static_cast<float>(a(i, k));
      t[i] = static_cast<float>(m.translation[i]);
    }
  }
  void apply(float x, float y, float z, float& ox, float& oy, float& oz) const {
    ox = z * (r[0] * x + r[1] * y + r[2]) + t[0];
    oy = z * (r[3] * x + r[4] * y + r[5]) + t[1];
    oz = z * (r[6] * x + r[7] * y + r[8]) + t[2];
  }
};

}  // namespace

void MotionOptions::check() const {}

MotionSegmenter::MotionSegmenter(const CameraModel& camera, const MotionOptions& options)
    : camera_(camera), options_(options), rays_(camera, options.cell) {
  options_.check();
}

Rigid3 MotionSegmenter::at_depth_time(const Rigid3& cam_from_world, double time, double depth_time) const {
  if (!last_ || time - last_->time <= 0 || time - last_->time > 0.2) return cam_from_world;
  const Rigid3 step = cam_from_world * last_->cam_from_world.inverse();
  const double share = (depth_time - time) / (time - last_->time);
  if (std::abs(share) > 2) return cam_from_world;
  Vector6d d;
  d << share * step.translation, share * vector_from_rotation(step.rotation);
  return rigid3_from_tangent(d) * cam_from_world;
}

void MotionSegmenter::reset() {
  while (!views_.empty()) { spare_.push_back(std::move(views_.front())); views_.pop_front(); }
  if (previous_) spare_.push_back(std::move(previous_));
  if (current_) spare_.push_back(std::move(current_));
  last_.reset();
}

MoverMask MotionSegmenter::segment(const std::shared_ptr<const RgbdImage>& image, const Rigid3& predicted) {
  if (!current_) {
    if (spare_.empty()) spare_.push_back(std::make_unique<MotionDepthGrid>());
    current_ = std::move(spare_.back());
    spare_.pop_back();
  }
  image_time_ = image->timestamp;
  depth_time_ = image->depth_timestamp;
  current_->set_depth(image->depth, rays_);
  current_->time = depth_time_;
  current_->cam_from_world = at_depth_time(predicted, image_time_, depth_time_);
  const int w = rays_.width(), h = rays_.height();
  if (tolerance_.empty()) tolerance_ = Image<float>(w, h);
  for (size_t i = 0; i < tolerance_.size(); ++i) {
    const float z = current_->depth.data()[i], a = z - 0.4f;
    tolerance_.data()[i] = static_cast<float>(options_.tolerance_base) + static_cast<float>(options_.tolerance_sigmas) * (0.0012f + 0.0019f * a * a);
  }
  carry();
  votes_ = Image<float>(w, h, 0.0f);
  still_ = Image<float>(w, h, 0.0f);
  match_ = Image<float>(w, h, 0.0f);
  const size_t n = views_.size(), k = std::min(n, static_cast<size_t>(options_.views_per_frame));
  for (size_t i = 0; i < k; ++i) compare(*views_[(turn_ + i * n / k) % n]);
  ++turn_;
  decide();
  return mask();
}

void MotionSegmenter::carry() {
  std::fill(current_->score.data(), current_->score.data() + current_->score.size(), 0.0f);
  known_ = Image<float>(rays_.width(), rays_.height(), 0.0f);
  if (!previous_) return;
  const Transform move(previous_->cam_from_world * current_->cam_from_world.inverse());
  const float keep = static_cast<float>(std::exp(-std::max(0.0, current_->time - previous_->time) / options_.memory));
  const float keep_hole = static_cast<float>(std::exp(-std::max(0.0, current_->time - previous_->time) / options_.hole_memory));
  const int w = rays_.width(), h = rays_.height();
  for (int y = 0, i = 0; y < h; ++y)
    for (int x = 0; x < w; ++x, ++i) {
      const float z = current_->depth.data()[i] > 0 ? current_->depth.data()[i] : 0.45f;
      float px, py, pz;
      const auto& ray = rays_.ray(static_cast<size_t>(i));
      move.apply(ray.x(), ray.y(), z, px, py, pz);
      if (pz < 0.1f) continue;
      const int c = rays_.cell_of(px, py, pz);
      if (c < 0) continue;
      if (!(current_->depth.data()[i] > 0)) {
        if (previous_->depth.data()[c] < static_cast<float>(options_.near_range)) { current_->score.data()[i] = keep_hole * std::max(0.0f, previous_->score.data()[c]); known_.data()[i] = 1; }
        continue;
      }
      const float tol = tolerance_.data()[i];
      const float d = previous_->depth.data()[c];
      if (d > 0 && std::abs(d - pz) < tol + 0.03f) { known_.data()[i] = 1; current_->score.data()[i] = keep * previous_->score.data()[c]; continue; }
      // moved: nearest cell of the same depth around
      const int cx = c % w, cy = c / w;
      float best = tol + 0.03f, score = 0;
      for (int dy = -2; dy <= 2; ++dy)
        for (int dx = -2; dx <= 2; ++dx) {
          if (!previous_->depth.contains(cx + dx, cy + dy)) continue;
          const float e = previous_->depth(cx + dx, cy + dy);
          if (e > 0 && std::abs(e - pz) < best) { best = std::abs(e - pz); score = previous_->score(cx + dx, cy + dy); known_.data()[i] = 1; }
        }
      current_->score.data()[i] = keep * score;
    }
}

void MotionSegmenter::compare(const MotionDepthGrid& view) {
  const Transform move(view.cam_from_world * current_->cam_from_world.inverse());
  const int n = rays_.width() * rays_.height();
  const float trust = static_cast<float>(std::min(1.0, (current_->time - view.time) / options_.age));
  for (int i = 0; i < n; ++i) {
    const bool hole = !(current_->depth.data()[i] > 0);
    const float z = hole ? 0.45f : current_->depth.data()[i];
    float px, py, pz;
    const auto& ray = rays_.ray(static_cast<size_t>(i));
    move.apply(ray.x(), ray.y(), z, px, py, pz);
    if (pz < 0.1f) continue;
    const int c = rays_.cell_of(px, py, pz);
    if (c < 0) continue;
    if (hole) {
      votes_.data()[i] += view.depth.data()[c] > 0 && view.depth(c % rays_.width(), c / rays_.width()) > pz ? 1.0f : 0.0f;
      continue;
    }
    const float near = view.nearest.data()[c], far = view.farthest.data()[c];
    if (!(far > 0)) continue;
    const float tol = tolerance_.data()[i];
    if (pz + tol < near) {
      if (!(view.depth.data()[c] > 0)) continue;
      const float b = near - 0.4f;
      const float tn = static_cast<float>(options_.tolerance_base) + static_cast<float>(options_.tolerance_sigmas) * (0.0012f + 0.0019f * b * b);
      if (pz + std::max(tol, tn) + static_cast<float>(options_.slope) * (far - near) < near) votes_.data()[i] += 1;
    } else if (pz < far + tol && view.score.data()[c] < 0.3f) {
      const bool contour = current_->farthest.data()[i] > z + 2 * tol + 0.03f * z;
      const bool contour_then = far > pz + 2 * tol + 0.03f * pz;
      match_.data()[i] += trust;
      still_.data()[i] += trust * (contour ? (contour_then ? static_cast<float>(options_.contour) : 0.0f) : static_cast<float>(options_.interior));
    }
  }
}

void MotionSegmenter::decide() {
  const int w = rays_.width(), h = rays_.height();
  const size_t n = static_cast<size_t>(w) * static_cast<size_t>(h);
  Image<float>& s = current_->score;
  const Image<float>& depth = current_->depth;
  if (link_x_.empty()) link_x_ = link_y_ = num_ = den_ = inverse_ = crease_ = Image<float>(w, h);
  for (size_t i = 0; i < n; ++i) inverse_.data()[i] = depth.data()[i] > 0 ? 1.0f / depth.data()[i] : 0.0f;
  const int k = 3;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const float q = inverse_(x, y);
      const float l = inverse_(std::max(0, x - k), y), r = inverse_(std::min(w - 1, x + k), y);
      const float u = inverse_(x, std::max(0, y - k)), d = inverse_(x, std::min(h - 1, y + k));
      const float cx = l > 0 && r > 0 && x >= k && x + k < w ? l + r - 2 * q : 0, cy = u > 0 && d > 0 && y >= k && y + k < h ? u + d - 2 * q : 0;
      crease_(x, y) = std::max(cx, cy);
    }
  const auto joined = [](float a, float b) { return std::abs(a - b) < 0.015f + 0.02f * std::min(a, b); };
  ++frames_;
  if (hole_share_.empty()) hole_share_ = Image<float>(w, h, 0.0f);
  for (size_t i = 0; i < n; ++i) hole_share_.data()[i] += ((depth.data()[i] > 0 ? 0.0f : 1.0f) - hole_share_.data()[i]) / static_cast<float>(std::min(frames_, 300));
  const auto opened = [&](int x, int y) { return votes_(x, y) > 0 && hole_share_(x, y) < 0.9f; };
  const float fade = static_cast<float>(1.414 * options_.cell / (camera_.fx * options_.reach));  // per cell and metre of depth
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const float z = depth(x, y);
      const auto link = [&](int x2, int y2) {
        const float z2 = depth(x2, y2);
        if (!(z > 0) || !(z2 > 0)) return std::max(z, z2) < static_cast<float>(options_.near_range) && (z > 0 || opened(x, y)) && (z2 > 0 || opened(x2, y2)) ? 1.0f / (1.0f + fade * 0.45f) : 0.0f;
        if (!joined(z, z2)) return 0.0f;
        return (std::max(crease_(x, y), crease_(x2, y2)) > static_cast<float>(options_.crease) ? 0.3f : 1.0f) / (1.0f + fade * z);
      };
      link_x_(x, y) = x > 0 ? link(x - 1, y) : 0;
      link_y_(x, y) = y > 0 ? link(x, y - 1) : 0;
    }
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const size_t i = static_cast<size_t>(y * w + x);
      float plus = 0;
      if (votes_.data()[i] > 0 && depth.data()[i] > 0 && x > 0 && y > 0 && x + 1 < w && y + 1 < h) {
        int support = 0;
        for (int dy = -1; dy <= 1; ++dy) for (int dx = -1; dx <= 1; ++dx) support += votes_(x + dx, y + dy) > 0 && depth(x + dx, y + dy) > 0;
        if (support >= 5) plus = votes_.data()[i] / (votes_.data()[i] + match_.data()[i]);
      }
      if (plus_.empty()) plus_ = Image<float>(w, h);
      plus_.data()[i] = plus;
      const float minus = plus > 0 ? 0 : std::min(still_.data()[i], 1.0f);
      const float state = std::clamp(s.data()[i], -1.0f, 1.0f), weight = static_cast<float>(options_.state) * std::abs(state);
      const float prior = static_cast<float>(depth.data()[i] > 0 ? options_.prior : options_.hole_prior);
      num_.data()[i] = plus - minus + weight * state - prior;
      den_.data()[i] = plus + minus + weight + prior;
    }
  for (int pass = 0; pass < 2; ++pass) {
    for (int y = 0; y < h; ++y) {
      float* a = num_.row(y); float* b = den_.row(y); const float* l = link_x_.row(y);
      for (int x = 1; x < w; ++x) { a[x] += l[x] * (a[x - 1] - a[x]); b[x] += l[x] * (b[x - 1] - b[x]); }
      for (int x = w - 2; x >= 0; --x) { a[x] += l[x + 1] * (a[x + 1] - a[x]); b[x] += l[x + 1] * (b[x + 1] - b[x]); }
    }
    for (int y = 1; y < h; ++y)
      for (int x = 0; x < w; ++x) { const float l = link_y_(x, y); num_(x, y) += l * (num_(x, y - 1) - num_(x, y)); den_(x, y) += l * (den_(x, y - 1) - den_(x, y)); }
    for (int y = h - 2; y >= 0; --y)
      for (int x = 0; x < w; ++x) { const float l = link_y_(x, y + 1); num_(x, y) += l * (num_(x, y + 1) - num_(x, y)); den_(x, y) += l * (den_(x, y + 1) - den_(x, y)); }
  }
  for (size_t i = 0; i < n; ++i) {
    const float d = den_.data()[i];
    if (d <= 0) continue;
    const float m = num_.data()[i] / d, conf = std::min(1.0f, d / static_cast<float>(options_.full_evidence));
    s.data()[i] = std::clamp((known_.data()[i] > 0 ? s.data()[i] : m) + m * conf, -static_cast<float>(options_.low), 3.0f);
  }
}

MoverMask MotionSegmenter::mask() const {
  MoverMask m;
  m.cell = options_.cell;
  const int w = rays_.width(), h = rays_.height();
  m.cells = Image<uint8_t>(w, h);
  for (size_t i = 0; i < m.cells.size(); ++i) m.cells.data()[i] = current_->score.data()[i] > static_cast<float>(options_.on) ? 255 : 0;
  dilate(m, 1);
  return m;
}

void MotionSegmenter::commit(const std::optional<Rigid3>& cam_from_world) {
  if (!current_) return;
  if (!cam_from_world) { reset(); return; }
  current_->cam_from_world = at_depth_time(*cam_from_world, image_time_, depth_time_);
  last_ = Pose{image_time_, *cam_from_world};
  if (previous_) {
    if (views_.empty() || (views_.size() == 1 && previous_->time - views_.back()->time > 0.06) || previous_->time - views_.back()->time >= options_.view_interval) {
      views_.push_back(std::move(previous_));
      if (views_.size() > static_cast<size_t>(options_.views)) {
        // thin out: drop the view whose loss leaves the smallest relative gap
        size_t drop = 1; double best = 1e9;
        for (size_t i = 1; i + 1 < views_.size(); ++i) {
          const double gap = (views_[i + 1]->time - views_[i - 1]->time) / (views_.back()->time - views_[i]->time + 0.3);
          if (gap < best) { best = gap; drop = i; }
        }
        if (views_.back()->time - views_.front()->time > 15) drop = 0;
        spare_.push_back(std::move(views_[drop]));
        views_.erase(views_.begin() + static_cast<long>(drop));
      }
    } else {
      spare_.push_back(std::move(previous_));
    }
  }
  previous_ = std::move(current_);
}

}  // namespace dkb
