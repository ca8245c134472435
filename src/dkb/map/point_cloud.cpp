// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/point_cloud.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "dkb/map/byte_stream.h"

namespace dkb {
namespace {

void write_position(ByteWriter& out, const Eigen::Vector3d& position) {
  for (int i = 0; i < 3; ++i) out.f32(static_cast<float>(position[i]));
}

}  // namespace

std::vector<std::vector<PointId>> points_by_map(const Map& map) {
  const std::vector<int> map_of = map.map_of_each();
  std::vector<std::vector<PointId>> points(std::max<size_t>(1, map.roots().size()));
  for (PointId id : map.live_points()) {
    const auto seen_by = static_cast<size_t>(map.point(id)->observations.front().keyframe);
    points[static_cast<size_t>(map_of[seen_by])].push_back(id);
  }
  return points;
}

std::string point_cloud_ply(const Map& map, const std::vector<PointId>& points) {
  ByteWriter out;
  out.raw(
      fmt::format("ply\n"
                  "format binary_little_endian 1.0\n"
                  "comment sparse map by dkb-slam; metres\n"
                  "element vertex {}\n"
                  "property float x\n"
                  "property float y\n"
                  "property float z\n"
                  "property uchar red\n"
                  "property uchar green\n"
                  "property uchar blue\n"
                  "property int observations\n"
                  "end_header\n",
                  points.size()));
  for (PointId id : points) {
    const MapPoint& p = *map.point(id);
    write_position(out, p.position);
    for (uint8_t channel : {p.colour.r, p.colour.g, p.colour.b}) out.u8(channel);
    out.i32(static_cast<int32_t>(p.observations.size()));
  }
  return out.take();
}

std::string point_cloud_pcd(const Map& map, const std::vector<PointId>& points) {
  ByteWriter out;
  out.raw(
      fmt::format("# .PCD v0.7 - Point Cloud Data file format\n"
                  "VERSION 0.7\n"
                  "FIELDS x y z rgb\n"
                  "SIZE 4 4 4 4\n"
                  "TYPE F F F U\n"
                  "COUNT 1 1 1 1\n"
                  "WIDTH {0}\n"
                  "HEIGHT 1\n"
                  "VIEWPOINT 0 0 0 1 0 0 0\n"
                  "POINTS {0}\n"
                  "DATA binary\n",
                  points.size()));
  for (PointId id : points) {
    const MapPoint& p = *map.point(id);
    write_position(out, p.position);
    out.u32(static_cast<uint32_t>(p.colour.r) << 16 | static_cast<uint32_t>(p.colour.g) << 8 | p.colour.b);
  }
  return out.take();
}

std::string point_cloud_json(const Map& map) {
  const std::vector<int> map_of = map.map_of_each();
  const auto number = [&](KeyframeId id) { return map_of[static_cast<size_t>(id)]; };
  std::string json = "{\"points\": [";
  const char* separator = "\n";
  for (PointId id : map.live_points()) {
    const MapPoint& p = *map.point(id);
    fmt::format_to(std::back_inserter(json),
                   "{}{{\"id\": {}, \"map\": {}, \"position\": [{}, {}, {}], \"colour\": [{}, {}, {}], "
                   "\"observations\": {}}}",
                   separator, p.id, number(p.observations.front().keyframe), p.position.x(), p.position.y(),
                   p.position.z(), p.colour.r, p.colour.g, p.colour.b, p.observations.size());
    separator = ",\n";
  }
  json += "],\n\"keyframes\": [";
  separator = "\n";
  for (KeyframeId id : map.live_keyframes()) {
    const Keyframe& k = *map.keyframe(id);
    const Rigid3 world_from_cam = k.cam_from_world.inverse();
    const Eigen::Vector3d& t = world_from_cam.translation;
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    fmt::format_to(std::back_inserter(json),
                   "{}{{\"id\": {}, \"map\": {}, \"timestamp\": {}, \"world_from_cam\": {{\"position\": [{}, {}, {}], "
                   "\"quaternion_xyzw\": [{}, {}, {}, {}]}}}}",
                   separator, id, number(id), k.timestamp, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    separator = ",\n";
  }
  return json + "]}\n";
}

}  // namespace dkb
