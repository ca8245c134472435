// SPDX-License-Identifier: Apache-2.0
/// \file
/// The map as users see it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

class Map;  // the library's own

/// A point of the still world.
struct PointInfo {
  uint32_t id = 0;                             ///< lasting; never used again for another point
  Eigen::Vector3d position_in_world{0, 0, 0};  ///< [m]
  Rgb colour;                                  ///< as the keyframe that made it sees it; grey for grey cameras
  int observations = 0;                        ///< keyframes that see it
  int map = 0;                                 ///< as KeyframeInfo::map: in whose world its position is
};

/// A neighbour in the covisibility graph.
struct CovisibleKeyframe {
  int id = 0;             ///< of the neighbour
  int shared_points = 0;  ///< map points that both see
};

/// A frame that the map rests on.
struct KeyframeInfo {
  int id = 0;                                ///< in order of insertion, from 0
  int64_t stamp_ns = 0;                      ///< of its colour image, to the microsecond
  int frame = 0;                             ///< index of its frame; below 0 for keyframes of a map that was loaded
  Rigid3 world_from_cam;                     ///< pose by the map as it is in this snapshot
  std::vector<CovisibleKeyframe> covisible;  ///< by decreasing shared points
  int map = 0;                               ///< 0 = the first map; maps that were not joined have worlds of their own
};

/// Two keyframes that were found to show the same place.
struct LoopInfo {
  int keyframe = 0, earlier_keyframe = 0;  ///< ids
  bool merge = false;                      ///< it joined two maps
};

/// The map at one moment, unchanged from then on however tracking goes on. Cheap to copy; safe to read from any thread.
class DKB_SLAM_API MapSnapshot {
 public:
  MapSnapshot();  ///< of an empty map
  /// The library enters here.
  MapSnapshot(std::shared_ptr<const Map> map, std::vector<LoopInfo> loops);

  size_t point_count() const;                                     ///< of points()
  int keyframe_count() const;                                     ///< of keyframes()
  std::vector<PointInfo> points() const;                          ///< by id
  std::vector<KeyframeInfo> keyframes() const;                    ///< by id
  const std::vector<LoopInfo>& loops() const { return loops_; }   ///< of this session, in order
  const std::shared_ptr<const Map>& map() const { return map_; }  ///< the library's own

 private:
  std::shared_ptr<const Map> map_;
  std::vector<LoopInfo> loops_;
};

/// Triangles in the world [m]; seen from outside, their corners run counter-clockwise.
struct SurfaceMesh {
  std::vector<Eigen::Vector3f> vertices;          ///< [m]
  std::vector<Rgb> colours;                       ///< per vertex
  std::vector<std::array<int32_t, 3>> triangles;  ///< three indices into `vertices` each
};

/// Where a robot can drive: cells of the floor, seen from above. Its axes are the floor's, not the world's: x along the
/// first view, z up, the origin below that of the world. A place of the world is at floor_from_world * place; the point
/// (x, y) of the grid is at floor_from_world.inverse() * (x, y, 0) in the world.
struct OccupancyGrid {
  static constexpr uint8_t kOccupied = 0, kUnknown = 205, kFree = 254;  ///< as ROS' map_saver writes them

  double cell = 0.05;                 ///< [m] side of a cell
  double origin_x = 0, origin_y = 0;  ///< [m] of the lower left corner of the lower left cell, on the floor
  Image<uint8_t> cells;               ///< row 0 is the top: the largest y
  Rigid3 floor_from_world;            ///< z = 0 is the floor, z up
  int map = 0;                        ///< whose world that is, as TrajectoryFrame::map
};

/// The dense map of the still world: people and what they moved are left out.
struct DenseMap {
  SurfaceMesh mesh;
  /// Nothing when no floor was found. It is the lowest large level surface seen so far: early on that may be a table.
  std::optional<OccupancyGrid> grid;
  int views = 0;  ///< keyframes that were fused
  int map = 0;    ///< that they are of, as TrajectoryFrame::map
};

/// Files of a dense map: Stanford PLY (binary), and the two files that ROS' map_server reads. `image` is the name of
/// the PGM within the YAML.
DKB_SLAM_API std::string mesh_ply(const SurfaceMesh& mesh);
DKB_SLAM_API std::string occupancy_pgm(const OccupancyGrid& grid);
DKB_SLAM_API std::string occupancy_yaml(const OccupancyGrid& grid, const std::string& image);

}  // namespace dkb
