// SPDX-License-Identifier: Apache-2.0
#include "library_support.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "dkb/image/rgbd_image.h"
#include "dkb/util/stamps.h"

namespace dkb::test {
namespace {

uint8_t block(uint64_t picture, int x, int y) {
  uint64_t h = picture * 0x9E3779B97F4A7C15u + static_cast<uint64_t>(x + 100000) * 0xBF58476D1CE4E5B9u +
               static_cast<uint64_t>(y) * 0x94D049BB133111EBu;
  h ^= h >> 29;
  h *= 0xBF58476D1CE4E5B9u;
  return static_cast<uint8_t>(h >> 40);
}

void append(std::string& out, const void* data, size_t size) {
  char hex[3];
  for (size_t i = 0; i < size; ++i) {
    std::snprintf(hex, sizeof hex, "%02x", static_cast<const uint8_t*>(data)[i]);
    out += hex;
  }
}
template <class T>
void append(std::string& out, const T& value) {
  append(out, &value, sizeof value);
}
void append(std::string& out, const Rigid3& pose) {
  append(out, pose.rotation.coeffs().data(), 4 * sizeof(double));
  append(out, pose.translation.data(), 3 * sizeof(double));
}
void append(std::string& out, const std::vector<TrajectoryFrame>& frames) {
  for (const TrajectoryFrame& f : frames) {
    out += "\n" + std::to_string(f.frame) + " " + std::to_string(f.stamp_ns) + " " + std::to_string(f.map) + " ";
    append(out, f.world_from_cam);
  }
}

}  // namespace

WallWorld::WallWorld(int width, int height, int period) : period_(period) {
  camera_.width = width, camera_.height = height;
  camera_.fx = camera_.fy = 0.8 * width;
  camera_.cx = 0.5 * (width - 1), camera_.cy = 0.5 * (height - 1);
}

Box WallWorld::card_at(int x) const {
  const auto h = static_cast<float>(camera_.height);
  return {static_cast<float>(x), 0.2f * h, 0.3f * h, 0.6f * h};
}

Frame WallWorld::frame(int index, const Look& look) const {
  constexpr int kBlock = 6, kCardBlock = 12;  // [px]
  const int w = camera_.width, h = camera_.height;
  std::vector<uint8_t> grey(static_cast<size_t>(w * h));
  std::vector<float> depth(grey.size());
  const Box card = card_at(look.card);
  for (int y = 0; y < h && !look.dark; ++y)
    for (int x = 0; x < w; ++x) {
      const size_t i = static_cast<size_t>(y * w + x);
      const bool on_card = card.contains(static_cast<float>(x), static_cast<float>(y));
      int column = x + look.shift;
      if (period_ > 0) column = (column % period_ + period_) % period_;
      grey[i] = look.blank ? 128
                : on_card  ? block(77, (x - look.card) / kCardBlock, y / kCardBlock)
                           : block(look.picture, (column + 100 * kBlock) / kBlock, y / kBlock);
      if (!look.flat) depth[i] = static_cast<float>(on_card ? kCard : kWall);
    }
  FrameInput input;
  input.stamp_ns = 33'333'333 * static_cast<int64_t>(index);
  input.colour = {grey.data(), w, h, 0, PixelFormat::grey8};
  input.depth = {depth.data(), w, h, 0, PixelFormat::depth_f32};
  return Frame(camera_, input);
}

Frame WallWorld::frame(int index, const Look& look, int64_t depth_stamp_ns) const {
  const Frame made = frame(index, look);
  auto image = std::make_shared<RgbdImage>(*made.image());
  image->depth_timestamp = seconds_from_ns(depth_stamp_ns);
  return Frame(std::move(image), made.stamp_ns(), depth_stamp_ns);
}

std::vector<Frame> WallWorld::walk(int from, int to, int enters) const {
  std::vector<Frame> frames;
  for (int i = from; i < to; ++i) {
    Look look{.shift = i};
    if (i >= enters) look.card = -camera_.width / 5 + (i - enters + 1) * camera_.width / 80;
    frames.push_back(frame(i, look));
  }
  return frames;
}

std::string bytes_of(const Slam& slam) {
  std::string out = "trajectory";
  append(out, slam.trajectory());
  append(out += "\nonline", slam.online_trajectory());
  append(out += "\nkeyframes", slam.keyframes());
  out += "\npoints";
  for (const PointInfo& p : slam.map().points()) {
    out += "\n" + std::to_string(p.id) + " " + std::to_string(p.observations) + " ";
    append(out, p.position_in_world.data(), 3 * sizeof(double));
    append(out, p.colour);
  }
  const Statistics s = slam.statistics();
  for (const int n : {s.frames, s.tracked, s.lost, s.relocalisations, s.keyframes, s.keyframes_inserted, s.maps,
                      s.loops, s.merges, s.points_created, s.points_culled, s.points_fused, s.points_retracted,
                      s.keyframes_culled, static_cast<int>(s.features_removed)})
    out += " " + std::to_string(n);
  return out + "\n";
}

std::string bytes_of(const FrameResult& r) {
  std::string out = std::to_string(r.frame) + " " + std::to_string(r.stamp_ns) + " " + name_of(r.state) + " " +
                    std::to_string(r.inliers) + " " + std::to_string(r.reference_keyframe) + " " +
                    std::to_string(r.keyframe) + " " + r.keyframe_explanation + "\n";
  if (r.world_from_cam) append(out, *r.world_from_cam);
  if (r.odom_from_cam) append(out, *r.odom_from_cam);
  if (r.covariance) append(out, r.covariance->data(), 36 * sizeof(double));
  append(out, r.world_from_odom);
  for (const Mover& m : r.movers) {
    out += "\n" + std::to_string(m.id) + m.class_name;
    append(out, m.position_in_world.data(), 3 * sizeof(double));
    append(out, m.velocity_in_world.data(), 3 * sizeof(double));
  }
  for (const Detection& d : r.detections) {
    out += "\n" + d.class_name;
    append(out, d.box);
    append(out, d.score);
  }
  out += "\n";
  append(out, r.mask.cells.data(), r.mask.cells.size());
  for (const FeatureReport& f : r.features) {
    append(out, f.image_x);
    append(out, f.image_y);
    out += std::string(name_of(f.state)) + name_of(f.reason);
  }
  return out + "\n";
}

std::string feed(Slam& slam, const std::vector<Frame>& frames) {
  std::string out;
  for (const Frame& frame : frames) out += bytes_of(slam.process(frame));
  return out;
}

std::string run(Slam& slam, const std::vector<Frame>& frames) {
  const std::string results = feed(slam, frames);
  slam.finish();
  return results + bytes_of(slam);
}

int leaked_points(const Slam& slam) {
  int leaked = 0;
  for (const PointInfo& p : slam.map().points())
    leaked += p.position_in_world.z() < 0.5 * (WallWorld::kCard + WallWorld::kWall);
  return leaked;
}

Detections DepthDetector::detect(const DetectorInput& image) {
  seen.push_back(image.stamp_ns);
  GreyImage mask(image.depth.width, image.depth.height);
  int left = mask.width(), right = 0, top = mask.height(), bottom = 0;
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x) {
      float z = 0;
      std::memcpy(&z, image.depth.row(y) + 4 * x, sizeof z);
      if (!(z > 0 && z < 1.5f)) continue;
      mask(x, y) = 255;
      left = std::min(left, x), right = std::max(right, x + 1);
      top = std::min(top, y), bottom = std::max(bottom, y + 1);
    }
  Detections found;
  if (right > left && gives_ != Gives::masks)
    found.boxes.push_back({"person",
                           {static_cast<float>(left), static_cast<float>(top), static_cast<float>(right - left),
                            static_cast<float>(bottom - top)},
                           0.9f});
  if (gives_ != Gives::boxes) found.mask = std::move(mask);
  return found;
}

std::string told(const std::vector<Event>& events) {
  std::string line;
  for (const Event& e : events)
    if (e.kind != Event::Kind::keyframe) line += std::to_string(e.frame) + ":" + name_of(e.kind) + " ";
  return line;
}

std::string error_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const InputError& e) {
    return e.what();
  } catch (const std::exception& e) {
    ADD_FAILURE() << "not an InputError: " << e.what();
  } catch (...) {
    ADD_FAILURE() << "no exception at all";
  }
  return "no error";
}

}  // namespace dkb::test
