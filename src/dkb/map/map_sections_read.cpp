// SPDX-License-Identifier: Apache-2.0
// Nothing is allocated from a number in the file before it is known that the file is long enough to mean it.
#include <bit>
#include <cmath>
#include <limits>

#include "dkb/map/byte_stream.h"
#include "dkb/map/entropy_coder.h"
#include "dkb/map/map_sections.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr size_t kDescriptorBytes = sizeof(Descriptor);
constexpr size_t kMinKeyframeBytes = 1 + 4 + 8 + 4 + 7 * 8 + 2;
constexpr size_t kMinPointBytes = 1 + 3 * 8;
constexpr size_t kMaxVarintBytes = 10;

template <class Integer>
Integer narrow(const ByteReader& in, int64_t v) {
  if (v < static_cast<int64_t>(std::numeric_limits<Integer>::min()) ||
      v > static_cast<int64_t>(std::numeric_limits<Integer>::max()))
    in.fail("holds a number out of range");
  return static_cast<Integer>(v);
}

template <class Integer>
Integer narrow_unsigned(const ByteReader& in, uint64_t v) {
  if (v > static_cast<uint64_t>(std::numeric_limits<Integer>::max())) in.fail("holds a number out of range");
  return static_cast<Integer>(v);
}

Descriptor read_descriptor(ByteReader& in) {
  Descriptor d;
  for (uint64_t& word : d) word = in.u64();
  return d;
}

float stepped(float prediction, uint32_t step) {
  return std::bit_cast<float>(std::bit_cast<uint32_t>(prediction) + (step >> 1 ^ (0u - (step & 1))));
}

std::string read_sized_packed(ByteReader& in, size_t items, size_t max_bytes_each) {
  const uint64_t size = in.u64();
  if (size > static_cast<uint64_t>(items) * max_bytes_each) in.fail("claims more than its items can be");
  return read_packed(in, static_cast<size_t>(size));
}

class ReadColours {
 public:
  ReadColours(ByteReader& in, size_t count)
      : g_(read_packed(in, count)), r_(read_packed(in, count)), b_(read_packed(in, count)) {}
  Rgb operator[](size_t i) const {
    const auto g = static_cast<uint8_t>(g_[i]);
    return {static_cast<uint8_t>(g + static_cast<uint8_t>(r_[i])), g,
            static_cast<uint8_t>(g + static_cast<uint8_t>(b_[i]))};
  }

 private:
  std::string g_, r_, b_;
};

MapFileContext read_head(std::string_view bytes) {
  ByteReader in(bytes, "section HEAD");
  MapFileContext context;
  CameraModel& c = context.camera;
  c.width = narrow<int>(in, in.u32());
  c.height = narrow<int>(in, in.u32());
  for (double* v : {&c.fx, &c.fy, &c.cx, &c.cy, &c.k1, &c.k2, &c.p1, &c.p2, &c.k3, &c.depth_factor, &c.fps,
                    &c.depth_min, &c.depth_max, &c.readout})
    *v = in.f64();
  context.scale_factor = in.f64();
  context.levels = narrow<int>(in, in.u32());
  if (in.left() > 0)
    for (double* v : {&c.k4, &c.k5, &c.k6}) *v = in.f64();
  in.expect_end();
  context.check();
  return context;
}

struct Keyframes {
  std::vector<Keyframe> all;
  std::vector<size_t> feature_counts;  // of the live ones, in turn
  size_t features = 0;                 // in all
};

Keyframes read_keyframes(std::string_view bytes, size_t descriptor_bytes) {
  ByteReader in(bytes, "section KEYF");
  Keyframes result;
  const size_t count = in.count(in.varint(), kMinKeyframeBytes);
  if (count > static_cast<size_t>(birth_keyframe(kNoPoint))) in.fail("has more keyframes than a map can hold");
  const size_t max_features = descriptor_bytes / kDescriptorBytes;
  result.all.reserve(count);
  for (size_t id = 0; id < count; ++id) {
    Keyframe k;
    k.id = static_cast<KeyframeId>(id);
    const uint8_t culled = in.u8();
    if (culled > 1) in.fail("has a keyframe that is neither live nor culled");
    k.culled = culled == 1;
    k.frame = in.i32();
    k.timestamp = in.f64();
    k.parent = in.i32();
    k.cam_from_world = read_pose(in);
    if (k.culled) {
      k.cam_from_parent = read_pose(in);
    } else {
      const uint64_t features = in.varint();
      if (features > static_cast<uint64_t>(kMaxFeaturesPerFrame) || features > max_features - result.features)
        in.fail("has a keyframe with more features than there are descriptors");
      result.features += static_cast<size_t>(features);
      result.feature_counts.push_back(static_cast<size_t>(features));
      k.covisible.resize(in.count(in.varint(), 2));
      for (Covisible& c : k.covisible) {
        c.keyframe = narrow_unsigned<KeyframeId>(in, in.varint());
        c.shared_points = narrow_unsigned<int>(in, in.varint());
      }
    }
    result.all.push_back(std::move(k));
  }
  in.expect_end();
  if (descriptor_bytes != result.features * kDescriptorBytes)
    in.fail("and section DESC disagree on the number of features");
  return result;
}

// Features of the live keyframes, in turn.
std::vector<std::shared_ptr<RgbdFeatures>> read_features(ByteReader& in, std::string_view descriptors,
                                                         const Keyframes& keyframes, const CameraModel& camera,
                                                         uint32_t format) {
  const UndistortionTable undistort(camera);
  const size_t n = keyframes.features;
  const auto image_x = read_packed_floats(in, n), image_y = read_packed_floats(in, n);
  const auto step_x = read_packed_words(in, n), step_y = read_packed_words(in, n);
  const auto depth = read_packed_floats(in, n), angle = read_packed_floats(in, n), response = read_packed_floats(in, n);
  const auto place_sigma = format >= 3 ? read_packed_floats(in, n) : std::vector<float>(n);
  const std::string octave = read_packed(in, n);
  const ReadColours colour(in, n);
  ByteReader descriptor_reader(descriptors, "section DESC");

  std::vector<std::shared_ptr<RgbdFeatures>> result;
  uint8_t octave_before = 0;
  size_t i = 0;
  for (size_t count : keyframes.feature_counts) {
    auto features = std::make_shared<RgbdFeatures>();
    features->keypoints.resize(count);
    features->descriptors.resize(count);
    for (size_t f = 0; f < count; ++f, ++i) {
      Keypoint& p = features->keypoints[f];
      p.image_pixel = {image_x[i], image_y[i]};
      if (!is_near_image(p.image_pixel)) in.fail("has a feature far outside its image");
      const Eigen::Vector2f prediction = undistort(image_x[i], image_y[i]);
      p.pixel = {stepped(prediction.x(), step_x[i]), stepped(prediction.y(), step_y[i])};
      if (format >= 3 && depth[i] < 0)
        p.lent_depth = -depth[i];
      else
        p.depth = depth[i];
      p.angle = angle[i];
      p.response = response[i];
      p.place_sigma = place_sigma[i];
      p.octave = octave_before = static_cast<uint8_t>(octave_before + static_cast<uint8_t>(octave[i]));
      p.colour = colour[i];
      features->descriptors[f] = read_descriptor(descriptor_reader);
      if (!is_near_image(p.pixel)) in.fail("has a feature far outside its image");
    }
    if (count > 0) features->grid = KeypointGrid(features->keypoints, camera.width, camera.height);
    result.push_back(std::move(features));
  }
  return result;
}

void read_points_seen(ByteReader& in, Keyframes& keyframes) {
  const std::string age_bytes = read_sized_packed(in, keyframes.features, kMaxVarintBytes);
  ByteReader ages(age_bytes, "section FEAT");
  size_t seen = 0;
  for (Keyframe& k : keyframes.all) {
    for (PointId& p : k.points) {
      const uint64_t code = ages.varint();
      if (code == 0) continue;
      const int64_t birth = static_cast<int64_t>(k.id) - signed_of(code - 1);
      if (birth < 0 || birth >= static_cast<int64_t>(keyframes.all.size()))
        in.fail("names a point born at a keyframe that is not there");
      p = make_point_id(static_cast<KeyframeId>(birth), 0);
      ++seen;
    }
  }
  ages.expect_end();
  const std::string low = read_packed(in, seen), high = read_packed(in, seen);
  size_t i = 0;
  for (Keyframe& k : keyframes.all) {
    for (size_t f = 0; f < k.points.size(); ++f) {
      PointId& p = k.points[f];
      if (p == kNoPoint) continue;
      const auto stored = static_cast<uint16_t>(static_cast<uint8_t>(low[i]) | static_cast<uint8_t>(high[i]) << 8);
      const auto feature = static_cast<uint16_t>(stored + (birth_keyframe(p) == k.id ? f : 0));
      if (feature >= kMaxFeaturesPerFrame) in.fail("names a point born at a feature that cannot be");
      p = make_point_id(birth_keyframe(p), feature);
      ++i;
    }
  }
}

void read_feature_section(std::string_view bytes, std::string_view descriptors, const MapFileContext& context,
                          uint32_t format, Keyframes& keyframes) {
  ByteReader in(bytes, "section FEAT");
  auto features = read_features(in, descriptors, keyframes, context.camera, format);
  size_t live = 0;
  for (Keyframe& k : keyframes.all) {
    if (!k.culled) {
      k.points.assign(features[live]->size(), kNoPoint);
      k.features = std::move(features[live++]);
    }
    if (const std::string flaw = flaw_of(k, context.levels); !flaw.empty()) throw InputError(flaw);
  }
  read_points_seen(in, keyframes);
  in.expect_end();
}

struct Points {
  std::vector<MapPoint> live;
  std::vector<uint64_t> descriptor_sources;  // per live point: number of an observation, from 1; 0 = has its descriptor
  std::vector<RemovedPoint> removed;
};

PointId next_id(ByteReader& in, PointId before, bool first) {
  const uint64_t step = in.varint();
  if ((step == 0 && !first) || step >= kNoPoint - before) in.fail("has point ids out of order");
  return before + static_cast<PointId>(step);
}

Points read_points(std::string_view bytes) {
  ByteReader in(bytes, "section POIN");
  Points points;
  const size_t n = in.count(in.varint(), kMinPointBytes);
  points.live.resize(n);
  points.descriptor_sources.resize(n);
  PointId before = 0;
  for (size_t i = 0; i < n; ++i) {
    MapPoint& p = points.live[i];
    p.id = before = next_id(in, before, i == 0);
    for (int a = 0; a < 3; ++a) p.position[a] = in.f64();
  }
  const auto nx = read_packed_floats(in, n), ny = read_packed_floats(in, n), nz = read_packed_floats(in, n);
  const auto distance = read_packed_floats(in, n), scale = read_packed_floats(in, n);
  const ReadColours colour(in, n);
  const std::string number_bytes = read_sized_packed(in, n, 4 * kMaxVarintBytes + kDescriptorBytes);
  ByteReader numbers(number_bytes, "section POIN");
  for (size_t i = 0; i < n; ++i) {
    MapPoint& p = points.live[i];
    p.normal = {nx[i], ny[i], nz[i]};
    p.reference_distance = distance[i];
    p.reference_scale = scale[i];
    p.colour = colour[i];
    p.found = narrow<int>(in, numbers.zigzag());
    p.visible = narrow<int>(in, numbers.zigzag());
    narrow<int32_t>(in, numbers.zigzag());  // of older programs: the keyframe that made it, less its birth
    points.descriptor_sources[i] = numbers.varint();
    if (points.descriptor_sources[i] == 0) p.descriptor = read_descriptor(numbers);
    if (const std::string flaw = flaw_of(p); !flaw.empty()) throw InputError(flaw);
  }
  numbers.expect_end();

  points.removed.resize(in.count(in.varint(), 2));
  before = 0;
  for (size_t i = 0; i < points.removed.size(); ++i) {
    RemovedPoint& r = points.removed[i];
    r.id = before = next_id(in, before, i == 0);
    const int64_t step = in.zigzag();
    if (step < -static_cast<int64_t>(r.id) || step >= static_cast<int64_t>(kNoPoint) - static_cast<int64_t>(r.id))
      in.fail("has a point replaced by one that cannot be");
    r.replaced_by = static_cast<PointId>(static_cast<int64_t>(r.id) + step);
  }
  in.expect_end();
  return points;
}

}  // namespace

Rigid3 read_pose(ByteReader& in) {
  Rigid3 pose;
  for (int i = 0; i < 4; ++i) pose.rotation.coeffs()[i] = in.f64();
  for (int i = 0; i < 3; ++i) pose.translation[i] = in.f64();
  return pose;
}

MapFile read_sections(const std::array<std::string_view, MapSections::kCount>& sections, uint32_t format) {
  const auto [head, keyframe_bytes, descriptors, feature_bytes, point_bytes, motions, planes] = sections;
  MapFile file;
  file.context = read_head(head);
  Keyframes keyframes = read_keyframes(keyframe_bytes, descriptors.size());
  read_feature_section(feature_bytes, descriptors, file.context, format, keyframes);
  if (!motions.empty()) read_motion_section(motions, keyframes.all);
  if (!planes.empty()) read_plane_section(planes, file.context.camera, keyframes.all);
  Points points = read_points(point_bytes);
  std::vector<std::pair<PointId, uint64_t>> sources;
  for (size_t i = 0; i < points.live.size(); ++i)
    if (points.descriptor_sources[i] > 0) sources.emplace_back(points.live[i].id, points.descriptor_sources[i]);
  file.map = Map::restore(std::move(keyframes.all), std::move(points.live), std::move(points.removed));
  for (const auto& [id, number] : sources) {
    MapPoint& p = file.map.edit_point(id);
    if (number > p.observations.size())
      throw InputError("point " + std::to_string(id) + " takes its descriptor from an observation that is not there");
    const Observation& o = p.observations[static_cast<size_t>(number - 1)];
    p.descriptor = file.map.keyframe(o.keyframe)->features->descriptors[static_cast<size_t>(o.feature)];
  }
  return file;
}

}  // namespace dkb
