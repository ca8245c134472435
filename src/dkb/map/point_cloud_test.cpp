// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/point_cloud.h"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "dkb/map/map_test_tools.h"

namespace dkb {
namespace {

// Keyframe 0 at (0, 0, 2) in the world sees an orange and a blue point.
Map two_points() {
  Map map;
  Random random(1);
  Keyframe k;
  k.id = 0;
  k.timestamp = 1305031102.175304;
  k.features = test::random_features(random, 3, CameraModel(), true);
  k.cam_from_world.translation = {0, 0, -2};
  map.add_keyframe(std::move(k));
  for (int i = 0; i < 2; ++i) {
    MapPoint p;
    p.id = make_point_id(0, i);
    p.position = i == 0 ? Eigen::Vector3d(0.5, -1, 4) : Eigen::Vector3d(0.1, 0.2, 0.3);
    p.colour = i == 0 ? Rgb{255, 128, 0} : Rgb{0, 0, 255};
    map.add_point(p);
    map.observe(p.id, 0, i);
  }
  return map;
}

float float_at(const std::string& bytes, size_t at) {
  float v;
  std::memcpy(&v, bytes.data() + at, sizeof v);
  return v;
}

TEST(PointCloud, PlyHasTheHeaderAndRowsOfTheFormat) {
  const std::string ply = point_cloud_ply(two_points(), two_points().live_points());
  const std::string end = "end_header\n";
  EXPECT_EQ(ply.substr(0, 4), "ply\n");
  EXPECT_NE(ply.find("format binary_little_endian 1.0\n"), std::string::npos);
  EXPECT_NE(ply.find("element vertex 2\n"), std::string::npos);
  const size_t at = ply.find(end) + end.size();
  ASSERT_EQ(ply.size(), at + 2 * (3 * 4 + 3 + 4));
  EXPECT_EQ(float_at(ply, at), 0.5f);
  EXPECT_EQ(float_at(ply, at + 4), -1.0f);
  EXPECT_EQ(float_at(ply, at + 8), 4.0f);
  EXPECT_EQ(ply.substr(at + 12, 7), std::string("\xff\x80\x00\x01\x00\x00\x00", 7));
  EXPECT_EQ(float_at(ply, at + 19), 0.1f);
}

TEST(PointCloud, PlyOfSomePointsHoldsTheseAlone) {
  const std::string ply = point_cloud_ply(two_points(), {make_point_id(0, 1)});
  EXPECT_NE(ply.find("element vertex 1\n"), std::string::npos);
  EXPECT_EQ(float_at(ply, ply.find("end_header\n") + 11), 0.1f);
}

TEST(PointCloud, PointsAndKeyframesTellWhichMapTheyAreOf) {
  Map map = two_points();
  EXPECT_EQ(points_by_map(Map()).size(), 1u);
  EXPECT_EQ(points_by_map(map).at(0), map.live_points());
  map.append(two_points());
  const auto points = points_by_map(map);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0], (std::vector{make_point_id(0, 0), make_point_id(0, 1)}));
  EXPECT_EQ(points[1], (std::vector{make_point_id(1, 0), make_point_id(1, 1)}));
  const nlohmann::json json = nlohmann::json::parse(point_cloud_json(map));
  for (const size_t i : {0u, 1u, 2u, 3u}) EXPECT_EQ(json["points"][i]["map"], i / 2) << i;
  for (const size_t i : {0u, 1u}) EXPECT_EQ(json["keyframes"][i]["map"], i) << i;
}

TEST(PointCloud, PcdHasTheHeaderAndRowsOfTheFormat) {
  const std::string pcd = point_cloud_pcd(two_points(), two_points().live_points());
  const std::string end = "DATA binary\n";
  EXPECT_NE(pcd.find("\nWIDTH 2\nHEIGHT 1\n"), std::string::npos);
  EXPECT_NE(pcd.find("\nPOINTS 2\n"), std::string::npos);
  const size_t at = pcd.find(end) + end.size();
  ASSERT_EQ(pcd.size(), at + 2 * 16);
  EXPECT_EQ(float_at(pcd, at + 8), 4.0f);
  EXPECT_EQ(pcd.substr(at + 12, 4), std::string("\x00\x80\xff\x00", 4));  // 0x00ff8000, low byte first
}

TEST(PointCloud, JsonHoldsPointsAndKeyframesWithAllDigits) {
  const nlohmann::json json = nlohmann::json::parse(point_cloud_json(two_points()));
  ASSERT_EQ(json["points"].size(), 2u);
  EXPECT_EQ(json["points"][0]["position"], nlohmann::json({0.5, -1.0, 4.0}));
  EXPECT_EQ(json["points"][1]["position"], nlohmann::json({0.1, 0.2, 0.3}));
  EXPECT_EQ(json["points"][1]["id"], 1);
  EXPECT_EQ(json["points"][0]["colour"], nlohmann::json({255, 128, 0}));
  EXPECT_EQ(json["points"][0]["observations"], 1);
  ASSERT_EQ(json["keyframes"].size(), 1u);
  EXPECT_EQ(json["keyframes"][0]["timestamp"], 1305031102.175304);
  EXPECT_EQ(json["keyframes"][0]["world_from_cam"]["position"], nlohmann::json({0.0, 0.0, 2.0}));
  EXPECT_EQ(json["keyframes"][0]["world_from_cam"]["quaternion_xyzw"], nlohmann::json({0.0, 0.0, 0.0, 1.0}));
}

TEST(PointCloud, RemovedPointsAreLeftOut) {
  Map map = two_points();
  map.remove_point(make_point_id(0, 0));
  EXPECT_NE(point_cloud_ply(map, map.live_points()).find("element vertex 1\n"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(point_cloud_json(map))["points"].size(), 1u);
}

TEST(PointCloud, TheEmptyMapIsAnEmptyCloud) {
  EXPECT_NE(point_cloud_ply(Map(), {}).find("element vertex 0\n"), std::string::npos);
  EXPECT_NE(point_cloud_pcd(Map(), {}).find("POINTS 0\n"), std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(point_cloud_json(Map()));
  EXPECT_TRUE(json["points"].empty());
  EXPECT_TRUE(json["keyframes"].empty());
}

}  // namespace
}  // namespace dkb
