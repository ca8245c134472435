// SPDX-License-Identifier: Apache-2.0
#include "export/map_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "dkb/map/point_cloud.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr double kCorner = 0.5;  // [px] from the corner of the top-left pixel to its centre, our origin

std::string camera_line(const Camera& c) {
  const std::string start =
      fmt::format("{} {} {} {} {} {}", c.width, c.height, c.fx, c.fy, c.cx + kCorner, c.cy + kCorner);
  if (!c.distorted()) return "1 PINHOLE " + start + "\n";
  return fmt::format("1 FULL_OPENCV {} {} {} {} {} {} {} {} {}\n", start, c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5,
                     c.k6);
}

// [px] RMS of the distances between where the keyframes saw the point and where they should have.
double reprojection_error(const Map& map, const MapPoint& point, const Camera& camera) {
  double sum = 0;
  for (const Observation& o : point.observations) {
    const Keyframe& k = *map.keyframe(o.keyframe);
    const Eigen::Vector2d seen = k.features->keypoints[static_cast<size_t>(o.feature)].pixel.cast<double>();
    sum += (camera.project(k.cam_from_world * point.position) - seen).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(1, point.observations.size())));
}

}  // namespace

std::string picture_name(const Keyframe& keyframe) {
  return stamp_text(ns_from_seconds(keyframe.timestamp)) + ".png";
}

std::vector<KeyframeId> keyframes_of_largest_map(const Map& map) {
  const std::vector<std::vector<KeyframeId>> by_map = map.keyframes_by_map();
  return *std::max_element(by_map.begin(), by_map.end(), [](auto& a, auto& b) { return a.size() < b.size(); });
}

void write_colmap(const MapFile& file, const std::vector<KeyframeId>& keyframes, const std::filesystem::path& folder) {
  const Map& map = file.map;
  const Camera& camera = file.context.camera;
  const std::set<KeyframeId> written(keyframes.begin(), keyframes.end());
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of each feature\n";
  std::map<PointId, int64_t> number;  // of the points, from 1
  for (PointId id : map.points_of(keyframes)) number.emplace(id, static_cast<int64_t>(number.size()) + 1);
  for (KeyframeId id : keyframes) {
    const Keyframe& k = *map.keyframe(id);
    const Eigen::Vector4d q =
        (k.cam_from_world.rotation.coeffs().array() + 0.0).matrix();  // x, y, z, w; turns -0 into 0
    const Eigen::Vector3d t = (k.cam_from_world.translation.array() + 0.0).matrix();
    images += fmt::format("{} {:.12g} {:.12g} {:.12g} {:.12g} {:.9g} {:.9g} {:.9g} 1 {}\n", id + 1, q.w(), q.x(), q.y(),
                          q.z(), t.x(), t.y(), t.z(), picture_name(k));
    for (size_t f = 0; f < k.points.size(); ++f) {
      const Eigen::Vector2d at = camera.distort(k.features->keypoints[f].pixel.cast<double>());
      const auto point = k.points[f] == kNoPoint ? number.end() : number.find(k.points[f]);
      images += fmt::format("{}{:.3f} {:.3f} {}", f == 0 ? "" : " ", at.x() + kCorner, at.y() + kCorner,
                            point == number.end() ? -1 : point->second);
    }
    images += '\n';
  }
  std::string points = "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each that sees it\n";
  for (const auto& [id, n] : number) {
    const MapPoint& p = *map.point(id);
    points += fmt::format("{} {:.6f} {:.6f} {:.6f} {} {} {} {:.3f}", n, p.position.x(), p.position.y(), p.position.z(),
                          p.colour.r, p.colour.g, p.colour.b, reprojection_error(map, p, camera));
    for (const Observation& o : p.observations) {
      if (written.contains(o.keyframe)) points += fmt::format(" {} {}", o.keyframe + 1, o.feature);
    }
    points += '\n';
  }
  const std::filesystem::path sparse = folder / "sparse" / "0";
  make_output_folder(sparse);
  write_file_atomically(sparse / "cameras.txt", "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n" + camera_line(camera));
  write_file_atomically(sparse / "points3D.txt", points);
  write_file_atomically(sparse / "images.txt", images);
}

void write_nerfstudio(const MapFile& file, const std::vector<KeyframeId>& keyframes, bool has_masks,
                      const std::filesystem::path& folder) {
  const Camera& c = file.context.camera;
  nlohmann::ordered_json model;
  model["camera_model"] = "OPENCV";
  model["w"] = c.width, model["h"] = c.height;
  model["fl_x"] = c.fx, model["fl_y"] = c.fy;
  model["cx"] = c.cx + kCorner, model["cy"] = c.cy + kCorner;
  model["k1"] = c.k1, model["k2"] = c.k2, model["p1"] = c.p1, model["p2"] = c.p2, model["k3"] = c.k3;
  model["ply_file_path"] = "sparse_pc.ply";
  model["frames"] = nlohmann::ordered_json::array();
  for (KeyframeId id : keyframes) {
    const Keyframe& k = *file.map.keyframe(id);
    const Rigid3 world_from_cam = k.cam_from_world.inverse();
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() = world_from_cam.matrix3() * Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
    pose.topRightCorner<3, 1>() = world_from_cam.translation;
    pose.array() += 0.0;  // turns -0 into 0
    nlohmann::ordered_json frame;
    frame["file_path"] = "images/" + picture_name(k);
    if (has_masks) frame["mask_path"] = "masks/" + picture_name(k);
    for (int row = 0; row < 4; ++row)
      frame["transform_matrix"].push_back({pose(row, 0), pose(row, 1), pose(row, 2), pose(row, 3)});
    model["frames"].push_back(std::move(frame));
  }
  make_output_folder(folder);
  write_file_atomically(folder / "sparse_pc.ply", point_cloud_ply(file.map, file.map.points_of(keyframes)));
  write_file_atomically(folder / "transforms.json", model.dump(1) + "\n");
}

}  // namespace dkb
