// SPDX-License-Identifier: Apache-2.0
#include "export/results_recording.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/map/map_file.h"
#include "dkb/map/point_cloud.h"
#include "dkb/recordings/recording_writer.h"
#include "dkb/recordings/ros_messages.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"
#include "dkb/util/text_rows.h"
#include "interrupt.h"

namespace dkb {
namespace {

constexpr const char* kMapFrame = "map";
constexpr const char* kCameraFrame = "camera";

struct SeenFeature {
  int x = 0, y = 0;  // [px]
  Rgb colour;
};
using FeaturesByStamp = std::map<int64_t, std::vector<SeenFeature>>;

Rgb colour_of(std::string_view state) {
  if (state == "used") return {40, 220, 60};
  if (state == "dynamic") return {235, 40, 40};
  if (state == "outlier") return {240, 210, 30};
  return {150, 150, 150};
}

// features.csv: `timestamp,x,y,state` with a row of names first.
FeaturesByStamp read_features(const std::filesystem::path& path) {
  FeaturesByStamp features;
  std::string text = read_file(path);
  for (char& c : text)
    if (c == ',') c = ' ';
  if (text.starts_with("timestamp ")) text.insert(0, "#");
  for_each_row(text, path.string(), [&](const std::string& place, const std::vector<std::string_view>& columns) {
    const auto stamp = parse_stamp_ns(columns[0]);
    if (!stamp || columns.size() < 4) throw InputError(place + ": a row must be `timestamp,x,y,state`");
    features[*stamp].push_back({static_cast<int>(std::lround(read_number(columns[1], place, "x"))),
                                static_cast<int>(std::lround(read_number(columns[2], place, "y"))),
                                colour_of(columns[3])});
  });
  return features;
}

ColourImage picture_of(const RgbdImage& image) {
  if (!image.colour.empty()) return image.colour;
  ColourImage colour(image.grey.width(), image.grey.height());
  for (size_t i = 0; i < colour.size(); ++i) {
    const uint8_t g = image.grey.data()[i];
    colour.data()[i] = {g, g, g};
  }
  return colour;
}

void draw(ColourImage& picture, const std::vector<SeenFeature>& features) {
  constexpr int kHalf = 2;  // [px] of the squares
  for (const SeenFeature& f : features)
    for (int y = f.y - kHalf; y <= f.y + kHalf; ++y)
      for (int x = f.x - kHalf; x <= f.x + kHalf; ++x) {
        const bool rim = std::abs(x - f.x) == kHalf || std::abs(y - f.y) == kHalf;
        if (rim && picture.contains(x, y)) picture(x, y) = f.colour;
      }
}

HeaderMessage header_at(int64_t stamp_ns, const char* frame) {
  HeaderMessage header;
  header.stamp_ns = stamp_ns;
  header.frame_id = frame;
  return header;
}

// Of the map that trajectory.txt is of: others have worlds of their own.
PointCloud2Message cloud_of(const Map& map, int64_t stamp_ns, std::vector<char>& bytes) {
  constexpr uint32_t kStep = 16;
  const std::vector<PointId> points = points_by_map(map).front();
  bytes.resize(points.size() * kStep);
  for (size_t i = 0; i < points.size(); ++i) {
    const MapPoint& p = *map.point(points[i]);
    const Eigen::Vector3f at = p.position.cast<float>();
    const uint32_t rgb = static_cast<uint32_t>(p.colour.r) << 16 | static_cast<uint32_t>(p.colour.g) << 8 | p.colour.b;
    std::memcpy(&bytes[i * kStep], at.data(), 12);
    std::memcpy(&bytes[i * kStep + 12], &rgb, 4);
  }
  PointCloud2Message cloud;
  cloud.header = header_at(stamp_ns, kMapFrame);
  cloud.width = static_cast<uint32_t>(points.size());
  cloud.fields = {{"x", 0, 7, 1}, {"y", 4, 7, 1}, {"z", 8, 7, 1}, {"rgb", 12, 7, 1}};
  cloud.point_step = kStep;
  cloud.row_step = kStep * cloud.width;
  cloud.data = {bytes.data(), bytes.size()};
  return cloud;
}

}  // namespace

size_t write_results_recording(const std::filesystem::path& results, Source* pictures,
                               const std::filesystem::path& out) {
  const Trajectory trajectory = read_trajectory(results / "trajectory.txt");
  if (trajectory.empty()) throw InputError((results / "trajectory.txt").string() + ": holds no pose");
  const std::filesystem::path map_path = results / "map.dkb";
  std::optional<MapFile> map;
  if (std::filesystem::exists(map_path)) map = load_map(map_path);
  FeaturesByStamp features;
  if (std::filesystem::exists(results / "features.csv")) features = read_features(results / "features.csv");

  const auto writer = write_recording(out);
  const size_t tf = writer->add_topic("/tf", "tf2_msgs/TFMessage");
  const size_t pose_topic = writer->add_topic("/pose", "geometry_msgs/PoseStamped");
  const size_t path_topic = writer->add_topic("/path", "nav_msgs/Path", true);
  const size_t cloud_topic = writer->add_topic("/map_points", "sensor_msgs/PointCloud2", true);
  const size_t image_topic =
      pictures == nullptr ? 0 : writer->add_topic("/features_image/compressed", "sensor_msgs/CompressedImage");

  const auto stamp_of = [](const StampedPose& p) {
    return parse_stamp_ns(p.stamp).value_or(ns_from_seconds(p.timestamp));
  };
  const auto write_picture = [&](const SourceFrame& next) {
    const int64_t stamp = next.frame.stamp_ns();
    ColourImage picture = picture_of(*next.frame.image());
    if (const auto seen = features.find(stamp); seen != features.end()) draw(picture, seen->second);
    const std::string jpeg = encode_jpeg(picture, 85);
    CompressedImageMessage message;
    message.header = header_at(stamp, kCameraFrame);
    message.format = "jpeg";
    message.data = jpeg;
    writer->write(image_topic, stamp, encode(message));
  };
  SourceFrame waiting;                    // the next picture, by time between the poses
  bool of_the_run = pictures == nullptr;  // a picture had the stamp of a pose
  const auto next_picture = [&] {
    do waiting = pictures->next();
    while (waiting.state == SourceState::skipped);
  };
  const auto write_pictures_until = [&](int64_t stamp) {
    Interrupt::check();
    while (waiting.state == SourceState::frame && waiting.frame.stamp_ns() <= stamp) {
      Interrupt::check();
      of_the_run = of_the_run || waiting.frame.stamp_ns() == stamp;
      write_picture(waiting);
      next_picture();
    }
  };
  if (pictures != nullptr) next_picture();
  PathMessage path;
  path.header = header_at(stamp_of(trajectory.front()), kMapFrame);
  for (const StampedPose& p : trajectory) {
    const int64_t stamp = stamp_of(p);
    write_pictures_until(stamp);
    PoseStampedMessage pose;
    pose.header = header_at(stamp, kMapFrame);
    pose.pose = {p.world_from_cam.translation, p.world_from_cam.rotation};
    TransformMessage transform;
    transform.header = pose.header;
    transform.child_frame_id = kCameraFrame;
    transform.transform = pose.pose;
    writer->write(tf, stamp, encode(TransformsMessage{transform}));
    writer->write(pose_topic, stamp, encode(pose));
    path.poses.push_back(std::move(pose));
  }
  if (!of_the_run)
    throw InputError("--images: no picture has the stamp of a pose; give the source of the run in " + results.string());
  const int64_t last = stamp_of(trajectory.back());
  writer->write(path_topic, last, encode(path));
  if (map) {
    std::vector<char> bytes;
    writer->write(cloud_topic, last, encode(cloud_of(map->map, last, bytes)));
  }
  write_pictures_until(std::numeric_limits<int64_t>::max());
  writer->close();
  return trajectory.size();
}

}  // namespace dkb
