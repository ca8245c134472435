// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "dkb/map/byte_stream.h"
#include "dkb/map/entropy_coder.h"
#include "dkb/map/map_sections.h"

namespace dkb {
namespace {

// How far `pixel` lies from its prediction, counted in floats; 0 when they are equal, small when they are near.
uint32_t step_from(float prediction, float pixel) {
  const uint32_t step = std::bit_cast<uint32_t>(pixel) - std::bit_cast<uint32_t>(prediction);
  return step << 1 ^ (0u - (step >> 31));
}

void write_descriptor(ByteWriter& out, const Descriptor& d) {
  for (uint64_t word : d) out.u64(word);
}

void write_sized_packed(ByteWriter& out, const std::string& bytes) {
  out.u64(bytes.size());
  write_packed(out, bytes);
}

// The three channels are much alike, so two of them are stored as differences.
class WrittenColours {
 public:
  void add(Rgb c) {
    g_.push_back(static_cast<char>(c.g));
    r_.push_back(static_cast<char>(c.r - c.g));
    b_.push_back(static_cast<char>(c.b - c.g));
  }
  void write(ByteWriter& out) const {
    write_packed(out, g_);
    write_packed(out, r_);
    write_packed(out, b_);
  }

 private:
  std::string g_, r_, b_;
};

std::string head_section(const MapFileContext& context) {
  ByteWriter out;
  const CameraModel& c = context.camera;
  out.u32(static_cast<uint32_t>(c.width));
  out.u32(static_cast<uint32_t>(c.height));
  for (double v : {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.depth_factor, c.fps, c.depth_min,
                   c.depth_max, c.readout})
    out.f64(v);
  out.f64(context.scale_factor);
  out.u32(static_cast<uint32_t>(context.levels));
  if (c.rational())
    for (double v : {c.k4, c.k5, c.k6}) out.f64(v);
  return out.bytes();
}

std::string keyframe_section(const Map& map) {
  ByteWriter out;
  out.varint(static_cast<uint64_t>(map.keyframe_count()));
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    const Keyframe& k = *map.keyframe(id);
    out.u8(k.culled);
    out.i32(k.frame);
    out.f64(k.timestamp);
    out.i32(k.parent);
    write_pose(out, k.cam_from_world);
    if (k.culled) {
      write_pose(out, k.cam_from_parent);
      continue;
    }
    out.varint(k.features->size());
    out.varint(k.covisible.size());
    for (const Covisible& c : k.covisible) {
      out.varint(static_cast<uint64_t>(c.keyframe));
      out.varint(static_cast<uint64_t>(c.shared_points));
    }
  }
  return out.bytes();
}

std::string descriptor_section(const Map& map) {
  ByteWriter out;
  for (KeyframeId id : map.live_keyframes())
    for (const Descriptor& d : map.keyframe(id)->features->descriptors) write_descriptor(out, d);
  return out.bytes();
}

void write_points_seen(ByteWriter& out, const Map& map) {
  ByteWriter ages;
  std::string low, high;
  for (KeyframeId id : map.live_keyframes()) {
    const Keyframe& k = *map.keyframe(id);
    for (size_t f = 0; f < k.points.size(); ++f) {
      if (k.points[f] == kNoPoint) {
        ages.varint(0);
        continue;
      }
      const int64_t age = static_cast<int64_t>(id) - birth_keyframe(k.points[f]);
      ages.varint(1 + (static_cast<uint64_t>(age) << 1 ^ static_cast<uint64_t>(age >> 63)));
      const auto feature = static_cast<uint16_t>(static_cast<size_t>(birth_feature(k.points[f])) - (age == 0 ? f : 0));
      low.push_back(static_cast<char>(feature));
      high.push_back(static_cast<char>(feature >> 8));
    }
  }
  write_sized_packed(out, ages.bytes());
  write_packed(out, low);
  write_packed(out, high);
}

std::string feature_section(const Map& map, const MapFileContext& context) {
  const UndistortionTable undistort(context.camera);
  std::vector<float> image_x, image_y, depth, angle, response, place_sigma;
  std::vector<uint32_t> step_x, step_y;
  std::string octave;
  WrittenColours colour;
  uint8_t octave_before = 0;
  for (KeyframeId id : map.live_keyframes())
    for (const Keypoint& k : map.keyframe(id)->features->keypoints) {
      const Eigen::Vector2f prediction = undistort(k.image_pixel.x(), k.image_pixel.y());
      image_x.push_back(k.image_pixel.x());
      image_y.push_back(k.image_pixel.y());
      step_x.push_back(step_from(prediction.x(), k.pixel.x()));
      step_y.push_back(step_from(prediction.y(), k.pixel.y()));
      depth.push_back(k.lent_depth > 0 && k.depth == 0 ? -k.lent_depth : k.depth);  // no -0
      angle.push_back(k.angle);
      response.push_back(k.response);
      place_sigma.push_back(k.place_sigma);
      octave.push_back(static_cast<char>(k.octave - octave_before));
      octave_before = k.octave;
      colour.add(k.colour);
    }
  ByteWriter out;
  write_packed_floats(out, image_x);
  write_packed_floats(out, image_y);
  write_packed_words(out, step_x);
  write_packed_words(out, step_y);
  for (const auto* column : {&depth, &angle, &response, &place_sigma}) write_packed_floats(out, *column);
  write_packed(out, octave);
  colour.write(out);
  write_points_seen(out, map);
  return out.bytes();
}

// Position of the first observation whose feature has the point's descriptor, from 1; 0 = none has.
uint64_t descriptor_source(const Map& map, const MapPoint& p) {
  for (size_t i = 0; i < p.observations.size(); ++i) {
    const Observation& o = p.observations[i];
    if (map.keyframe(o.keyframe)->features->descriptors[static_cast<size_t>(o.feature)] == p.descriptor) return i + 1;
  }
  return 0;
}

std::string point_section(const Map& map) {
  ByteWriter out, numbers;
  const std::vector<PointId> live = map.live_points();
  out.varint(live.size());
  std::vector<float> normal[3], distance, scale;
  WrittenColours colour;
  PointId before = 0;
  for (PointId id : live) {
    const MapPoint& p = *map.point(id);
    if (birth_keyframe(id) >= map.keyframe_count())
      throw std::logic_error("map: point " + std::to_string(id) + " was born at a keyframe that is not there");
    if (const std::string flaw = flaw_of(p); !flaw.empty()) throw std::logic_error("map: " + flaw);
    out.varint(id - before);
    before = id;
    for (int i = 0; i < 3; ++i) out.f64(p.position[i]);
    for (int i = 0; i < 3; ++i) normal[i].push_back(p.normal[i]);
    distance.push_back(p.reference_distance);
    scale.push_back(p.reference_scale);
    colour.add(p.colour);
    numbers.zigzag(p.found);
    numbers.zigzag(p.visible);
    numbers.zigzag(0);
    const uint64_t source = descriptor_source(map, p);
    numbers.varint(source);
    if (source == 0) write_descriptor(numbers, p.descriptor);
  }
  for (const auto* column : {&normal[0], &normal[1], &normal[2], &distance, &scale}) write_packed_floats(out, *column);
  colour.write(out);
  write_sized_packed(out, numbers.bytes());

  std::vector<RemovedPoint> forwarded;
  for (const RemovedPoint& r : map.removed_points())
    if (const PointId survivor = map.resolve(r.id); survivor != kNoPoint) forwarded.push_back({r.id, survivor});
  out.varint(forwarded.size());
  before = 0;
  for (const RemovedPoint& r : forwarded) {
    if (birth_keyframe(r.id) >= map.keyframe_count())
      throw std::logic_error("map: point " + std::to_string(r.id) + " was born at a keyframe that is not there");
    out.varint(r.id - before);
    before = r.id;
    out.zigzag(static_cast<int64_t>(r.replaced_by) - static_cast<int64_t>(r.id));
  }
  return out.bytes();
}

}  // namespace

bool is_near_image(const Eigen::Vector2f& pixel) {
  constexpr float kMaxPixel = 1e6F;                                             // far beyond any image
  return std::abs(pixel.x()) <= kMaxPixel && std::abs(pixel.y()) <= kMaxPixel;  // false for NaN
}

bool sound(const Rigid3& pose) {
  return pose.rotation.coeffs().allFinite() && pose.translation.allFinite() &&
         std::abs(pose.rotation.squaredNorm() - 1.0) < 1e-6;
}

void write_pose(ByteWriter& out, const Rigid3& pose) {
  for (int i = 0; i < 4; ++i) out.f64(pose.rotation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) out.f64(pose.translation[i]);
}

std::string flaw_of(const Keyframe& keyframe, int levels) {
  const std::string name = "keyframe " + std::to_string(keyframe.id);
  if (!std::isfinite(keyframe.timestamp)) return name + " has no finite timestamp";
  if (!sound(keyframe.cam_from_world) || !sound(keyframe.cam_from_parent)) return name + " has an impossible pose";
  if (!keyframe.features) return "";
  for (const Keypoint& k : keyframe.features->keypoints) {
    if (!is_near_image(k.pixel) || !is_near_image(k.image_pixel)) return name + " has a feature far outside its image";
    for (float depth : {k.depth, k.lent_depth})
      if (!std::isfinite(depth) || depth < 0) return name + " has a feature with an impossible depth";
    if (!std::isfinite(k.place_sigma) || k.place_sigma < 0) return name + " has a feature of impossible accuracy";
    if (!std::isfinite(k.angle) || !std::isfinite(k.response)) return name + " has a feature that is not finite";
    if (k.octave >= levels) return name + " has a feature above the pyramid's levels";
  }
  return "";
}

std::string flaw_of(const MapPoint& point) {
  if (point.position.allFinite() && point.normal.allFinite() && std::isfinite(point.reference_distance) &&
      std::isfinite(point.reference_scale))
    return "";
  return "point " + std::to_string(point.id) + " is not finite";
}

MapSections write_sections(const Map& map, const MapFileContext& context) {
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id)
    if (const std::string flaw = flaw_of(*map.keyframe(id), context.levels); !flaw.empty())
      throw std::logic_error("map: " + flaw);
  return {{head_section(context), keyframe_section(map), descriptor_section(map), feature_section(map, context),
           point_section(map), motion_section(map), plane_section(map, context.camera)}};
}

}  // namespace dkb
