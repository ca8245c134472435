// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/simulator.h"
#include "dkb/simulator/camera_path.h"
#include "dkb/simulator/simulator_test_tools.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {

SimulatorOptions small(const std::string& scene, int frames = 0) {
  return test::small_images(scene, frames, 320, 240);
}

double degrees_between(const Rigid3& a, const Rigid3& b) {
  return vector_from_rotation(a.rotation.conjugate() * b.rotation).norm() * 57.29578;
}

std::string error_of(const SimulatorOptions& o) {
  return test::input_error_of([&] { const Simulator s(o); });
}

class SimulatorFiles : public testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  test::TempFolder folder_;
};

TEST(Simulator, DepthOfOneFrameProjectsOntoDepthOfAnother) {
  // Every pixel of frame 0, taken to frame 12 by the true poses, meets the surface that frame 12 sees there, unless
  // something else stands in front.
  const Simulator s(small("room", 20));
  const SimulatedFrame a = s.render(0), b = s.render(12);
  ASSERT_GT((a.world_from_cam.translation - b.world_from_cam.translation).norm(), 0.02);
  int seen = 0, met = 0;
  double sum = 0;
  for (int y = 0; y < 240; y += 3)
    for (int x = 0; x < 320; x += 3) {
      const Eigen::Vector3d p =
          b.world_from_cam.inverse() * (a.world_from_cam * s.camera().unproject({x, y}, a.true_depth(x, y)));
      const Eigen::Vector2d q = s.camera().project(p);
      const int u = static_cast<int>(std::lround(q.x())), v = static_cast<int>(std::lround(q.y()));
      if (p.z() < 0.1 || !b.true_depth.contains(u, v)) continue;
      ++seen;
      const double e = std::abs(1 / p.z() - 1 / b.true_depth(u, v)) * p.z();
      if (e < 0.02) {
        ++met;
        sum += e;
      }
    }
  EXPECT_GT(seen, 5000);
  EXPECT_GT(met, 0.93 * seen);
  EXPECT_LT(sum / met, 0.004);  // half a pixel on slanted surfaces
}

TEST(Simulator, MeasuredDepthIsOffByTheNoiseOfItsRange) {
  // 0.92 (0.0012 + 0.0019 (z - 0.4)^2) m, and a disparity step of 1/8 px: z^2 / (8 f b) wide, spread / sqrt(12).
  SimulatorOptions o = small("rush", 6);
  o.people = 0;  // nothing moves, so that truth holds at the depth stamp too
  const Simulator s(o);
  const double fb = s.camera().fx * 0.075;
  std::map<int, std::vector<double>> errors;  // by range in half metres
  double steps_off = 0;
  for (int i = 0; i < s.frames(); ++i) {
    const SimulatedFrame f = s.render(i);
    for (int y = 2; y < 238; ++y)
      for (int x = 2; x < 318; ++x) {
        const double z = f.image.depth(x, y), truth = f.true_depth(x, y);
        if (z <= 0) continue;
        const double step = 8 * fb / z;
        if (z < 3) steps_off = std::max(steps_off, std::abs(step - std::round(step)));
        bool flat = true;  // outlines wander by a pixel or two
        for (int d = -2; d <= 2; ++d)
          flat = flat && std::abs(f.true_depth(x + d, y) - truth) < 0.004 &&
                 std::abs(f.true_depth(x, y + d) - truth) < 0.03;
        if (flat) errors[static_cast<int>(truth * 2)].push_back(z - truth);
      }
  }
  EXPECT_LT(steps_off, 0.02);  // what rounding to 0.2 mm leaves
  int ranges = 0;
  for (const auto& [range, e] : errors) {
    if (e.size() < 3000) continue;
    ++ranges;
    double sum2 = 0, expected2 = 0;
    const double z = 0.5 * range + 0.25, step = z * z / (8 * fb);
    for (const double v : e) sum2 += v * v;
    expected2 = std::pow(0.92 * (0.0012 + 0.0019 * (z - 0.4) * (z - 0.4)), 2) + step * step / 12;
    EXPECT_NEAR(std::sqrt(sum2 / static_cast<double>(e.size())) / std::sqrt(expected2), 1.0, 0.35) << z << " m";
  }
  EXPECT_GE(ranges, 2);
}

TEST(Simulator, GreyNoiseHasTheSpreadAskedFor) {
  SimulatorOptions o = small("rush", 2);
  o.people = 0;
  const Simulator still(o);
  const SimulatedFrame a = still.render(0), b = still.render(1);
  double sum2 = 0;
  for (size_t i = 0; i < a.image.grey.size(); ++i) sum2 += std::pow(a.image.grey.data()[i] - b.image.grey.data()[i], 2);
  const double sigma = std::sqrt(sum2 / static_cast<double>(a.image.grey.size()) / 2);
  EXPECT_GT(sigma, 2.2);
  EXPECT_LT(sigma, 2.7);
}

TEST(Simulator, ColourAndDepthStampsAreUpToSixteenMillisecondsApart) {
  const Simulator s(small("rush", 40));
  double largest = 0, before = 0;
  for (int i = 0; i < 12; ++i) {
    const SimulatedFrame f = s.render(i);
    largest = std::max(largest, std::abs(f.image.timestamp - f.image.depth_timestamp));
    EXPECT_GT(f.image.depth_timestamp, before);
    EXPECT_DOUBLE_EQ(f.image.timestamp, std::stod(f.stamp));
    before = f.image.depth_timestamp;
  }
  EXPECT_GT(largest, 0.004);
  EXPECT_LE(largest, 0.0161);
}

TEST(Simulator, DepthHasHolesButIsMostlyThere) {
  const Simulator s(small("room", 10));
  const SimulatedFrame f = s.render(3);
  const auto n = static_cast<double>(f.image.depth.size());
  const double holes =
      static_cast<double>(std::count(f.image.depth.data(), f.image.depth.data() + f.image.depth.size(), 0.0F)) / n;
  EXPECT_GT(holes, 0.02);
  EXPECT_LT(holes, 0.4);
}

TEST(Simulator, CameraOfRushStandsStill) {
  const Simulator s(small("rush"));
  const Rigid3 first = s.world_from_cam(0);
  for (double t = 0; t < 10; t += 0.37) {
    EXPECT_EQ(s.world_from_cam(t).translation, first.translation);
    EXPECT_EQ(s.world_from_cam(t).rotation.coeffs(), first.rotation.coeffs());
  }
}

TEST(Simulator, CartOfStraightDrivesFiveMetresOnALine) {
  const Simulator s(small("straight"));
  EXPECT_EQ(s.frames(), 300);
  const auto at = [&](int i) { return s.world_from_cam(s.stamp(i) - s.stamp(0)); };
  const Eigen::Vector3d a = at(0).translation, b = at(299).translation;
  EXPECT_NEAR((b - a).norm(), 5.0, 1e-4);
  for (int i = 0; i < 300; i += 7) {
    EXPECT_LT((at(i).translation - a).cross((b - a).normalized()).norm(), 1e-9);
    EXPECT_LT(degrees_between(at(i), at(0)), 1e-6);
  }
}

TEST(Simulator, SpinTurnsBySixtyDegreesASecond) {
  const Simulator s(small("spin"));
  double sum = 0;
  for (int i = 1; i < 300; ++i) sum += degrees_between(s.world_from_cam((i - 1) / 30.0), s.world_from_cam(i / 30.0));
  EXPECT_GT(sum / (299 / 30.0), 50);
  EXPECT_LT(sum / (299 / 30.0), 80);
}

TEST(Simulator, LoopRunsTwentyMetresBackOverItsStart) {
  const Simulator s(small("loop"));
  EXPECT_EQ(s.frames(), 900);
  double length = 0, nearest = 1e9, angle = 0;
  for (int i = 1; i < 900; ++i) {
    const Rigid3 a = s.world_from_cam((i - 1) / 30.0), b = s.world_from_cam(i / 30.0), first = s.world_from_cam(0);
    length += (b.translation - a.translation).norm();
    const double d = (b.translation - first.translation).norm();
    if (i > 600 && d < nearest) {
      nearest = d;
      angle = degrees_between(b, first);
    }
  }
  EXPECT_GT(length, 18);
  EXPECT_LT(length, 23);
  EXPECT_LT(nearest, 0.05);
  EXPECT_LT(angle, 5);
}

TEST(Simulator, TwinsNeverComeBackToAViewTheyLeft) {
  const Simulator s(small("twins"));
  EXPECT_EQ(s.frames(), 900);
  // The optical axis meets the wall (about 2 m ahead) ever further east, but for the hand's tremor.
  double furthest = -1e9, back = 0;
  for (int i = 0; i < 900; ++i) {
    const Rigid3 p = s.world_from_cam(i / 30.0);
    const Eigen::Vector3d ahead = p.rotation * Eigen::Vector3d::UnitZ();
    ASSERT_GT(ahead.y(), 0.9);
    const double x = p.translation.x() + 2 * ahead.x() / ahead.y();
    furthest = std::max(furthest, x);
    back = std::max(back, furthest - x);
  }
  EXPECT_LT(back, 0.15);  // a twentieth of what the picture shows
  EXPECT_GT(furthest, 9);
}

TEST(Simulator, TwinRoomsLookAlike) {
  SimulatorOptions o = small("twins");
  o.grey_noise = 0;
  const Simulator s(o);
  // The same place in both rooms: 7 m apart.
  int first = 200, second = 0;
  const double x = s.world_from_cam(first / 30.0).translation.x();
  for (int i = 400; i < 900; ++i)
    if (std::abs(s.world_from_cam(i / 30.0).translation.x() - x - 7.0) <
        std::abs(s.world_from_cam(second / 30.0).translation.x() - x - 7.0))
      second = i;
  const GreyImage a = s.render(first).image.grey, b = s.render(second).image.grey;
  double ma = 0, mb = 0, ab = 0, aa = 0, bb = 0;
  const auto n = static_cast<double>(a.size());
  for (size_t i = 0; i < a.size(); ++i) {
    ma += a.data()[i] / n;
    mb += b.data()[i] / n;
  }
  for (size_t i = 0; i < a.size(); ++i) {
    const double p = a.data()[i] - ma, q = b.data()[i] - mb;
    ab += p * q;
    aa += p * p;
    bb += q * q;
  }
  EXPECT_GT(ab / std::sqrt(aa * bb), 0.6);
  EXPECT_NE(a, b);
}

TEST(Simulator, PersonOfCoverHidesMoreThanSixtyPercent) {
  const Simulator s(small("cover"));
  for (int i = 85; i < 230; i += 36) {
    const GreyImage mask = s.render(i).mask;
    EXPECT_GT(std::count(mask.data(), mask.data() + mask.size(), 255), 0.6 * static_cast<double>(mask.size()))
        << "frame " << i;
  }
  EXPECT_TRUE(s.render(0).movers.empty());
}

TEST(Simulator, ChairIsNoPerson) {
  const Simulator s(small("chair"));
  const SimulatedFrame f = s.render(60);
  ASSERT_EQ(f.movers.size(), 1U);
  EXPECT_EQ(f.movers[0].kind, "chair");
}

TEST(Simulator, PeopleNeverTouchTheCamera) {
  for (const char* scene : {"crowd", "straight", "rush", "cover", "chair"})
    for (uint64_t seed = 1; seed <= 2; ++seed) {
      SimulatorOptions o = small(scene);
      o.seed = seed;
      const Simulator s(o);
      double nearest = 1e9;
      for (int i = 0; i < s.frames(); ++i) nearest = std::min(nearest, s.nearest_mover(i / 30.0));
      EXPECT_GT(nearest, 0.5) << scene << " seed " << seed;
    }
}

TEST(Simulator, BoxesMasksAndPositionsAgree) {
  const Simulator s(small("crowd", 60));
  const SimulatedFrame f = s.render(30);
  ASSERT_FALSE(f.movers.empty());
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) {
      if (f.mask(x, y) == 0) continue;
      EXPECT_TRUE(std::any_of(f.movers.begin(), f.movers.end(), [&](const SimulatedMover& m) {
        return x >= m.box_x && y >= m.box_y && x < m.box_x + m.box_width && y < m.box_y + m.box_height;
      }));
    }
  for (const SimulatedMover& m : f.movers) {
    EXPECT_EQ(m.kind, "person");
    // The median of what is seen of a person lies in the picture's box and above the floor.
    const Eigen::Vector3d p = f.world_from_cam.inverse() * m.position_in_world;
    const Eigen::Vector2d q = s.camera().project(p);
    EXPECT_GT(q.x(), m.box_x - 20);
    EXPECT_LT(q.x(), m.box_x + m.box_width + 20);
    EXPECT_GT(m.position_in_world.z(), 0);
    EXPECT_LT(m.position_in_world.z(), 2);
  }
}

TEST_F(SimulatorFiles, CameraFollowsAGivenPath) {
  std::string text = "# a comment\n";
  for (int i = 200; i >= 0; --i)  // the wrong way round: rows are sorted
    text += std::to_string(i * 0.02) + " " + std::to_string(1 + 0.001 * i) + " 2 1.5 -0.7071068 0 0 0.7071068\n";
  text += "1 9 9 9 0 0 0 1\n";  // a stamp once more: the first row counts
  SimulatorOptions o = small("room", 60);
  o.path = file("path.txt", text);
  const Simulator s(o);
  EXPECT_EQ(s.frames(), 60);
  EXPECT_NEAR(s.stamp(0), 0, 1e-9);
  for (const double t : {0.5, 1.0, 1.5}) {
    EXPECT_LT((s.world_from_cam(t).translation - Eigen::Vector3d(1 + 0.05 * t, 2, 1.5)).norm(), 1e-6) << t;
    EXPECT_LT(degrees_between(s.world_from_cam(t),
                              Rigid3(Eigen::Quaterniond(0.7071068, -0.7071068, 0, 0), Eigen::Vector3d::Zero())),
              1e-3);
  }
  // The first depth image is older than the path, which starts at 0.
  const SimulatedFrame first = s.render(0);
  EXPECT_LT(first.image.depth_timestamp, 0);
  EXPECT_DOUBLE_EQ(std::stod(first.depth_stamp), first.image.depth_timestamp);
  o.frames = 1000;
  const Simulator longer(o);
  EXPECT_EQ(longer.frames(), 121);
  ASSERT_EQ(longer.notes().size(), 1U);
}

TEST(SmoothPath, IsTheSameUpToWhatIsAskedFor) {
  std::vector<sim::TimedPose> poses;
  for (int i = 0; i < 100; ++i)
    poses.push_back({0.1 * i, sim::camera_pose({std::sin(i), std::cos(2.0 * i), 0.1 * (i % 7)}, 0.3 * i, 0.1)});
  const sim::CameraPath whole = sim::smooth_path(poses, 0.03), part = sim::smooth_path(poses, 0.03, 3.01);
  for (double t = -0.1; t < 3.01; t += 0.003) {
    EXPECT_EQ(part(t).translation, whole(t).translation) << t;
    EXPECT_EQ(part(t).rotation.coeffs(), whole(t).rotation.coeffs()) << t;
  }
  EXPECT_NE(part(8).translation, whole(8).translation);
}

TEST_F(SimulatorFiles, BadPathNamesFileAndLine) {
  SimulatorOptions o = small("room");
  o.path = file("path.txt", "0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n");
  EXPECT_NE(error_of(o).find("path.txt:2"), std::string::npos) << error_of(o);
  o.path = file("short.txt", "0 0 0 0 0 0 0 1\n");
  EXPECT_NE(error_of(o).find("at least 2"), std::string::npos) << error_of(o);
  o.path = file("long.txt", "5 0 0 0 0 0 0 1\n10000005 1 0 0 0 0 0 1\n");
  EXPECT_NE(error_of(o).find("long.txt: its stamps reach from 5.000 to 10000005.000 s"), std::string::npos)
      << error_of(o);
}

TEST(Simulator, UnknownSceneNamesTheNearest) {
  EXPECT_NE(error_of(small("crowds")).find("did you mean \"crowd\"?"), std::string::npos);
  SimulatorOptions o = small("room");
  o.people = 31;
  EXPECT_NE(error_of(o).find("--people: 31 is out of range"), std::string::npos);
  o = small("room"), o.height = 5000;
  EXPECT_EQ(error_of(o), "--size HEIGHT: 5000 is out of range; it must be 64 ... 4096 px");
}

TEST_F(SimulatorFiles, SceneFileBuildsAScene) {
  SimulatorOptions o =
      small(file("scene.yaml",
                 "frames: 7\ntremor: 0\nroom: {size: [5, 4], furnished: false}\n"
                 "path:\n  - {time: 0, position: [0, -1.5, 1.4], look_at: [0, 1, 0.8]}\n"
                 "objects:\n  - {kind: box, position: [0, 1, 1], size: [0.5, 0.5, 0.5], material: carton}\n"
                 "movers:\n  - {class: chair, waypoints: [{time: 0, position: [0, 0]}]}\n"));
  const Simulator s(o);
  EXPECT_EQ(s.frames(), 7);
  const SimulatedFrame f = s.render(0);
  EXPECT_EQ(f.movers.size(), 1U);
  // The box's face is 2.25 m ahead, which the picture's middle sees 0.6 m lower for each 2.5 m: at z 0.86 m.
  EXPECT_NEAR(f.true_depth(160, 120), std::hypot(2.25, 2.25 * 0.6 / 2.5), 0.01);
}

TEST_F(SimulatorFiles, ARollingShutterDoesNotMoveWhatStands) {
  // The camera turns 127 degrees in half a second past a chair that stands in the lower rows, which are read last.
  SimulatorOptions o = small(file("scene.yaml",
                                  "frames: 15\ntremor: 0\nroom: {size: [5, 4], furnished: false}\n"
                                  "path:\n  - {time: 0, position: [0, -1, 1.4], look_at: [-2, 0, 1.4]}\n"
                                  "  - {time: 0.5, position: [0, -1, 1.4], look_at: [2, 0, 1.4]}\n"
                                  "movers:\n  - {class: chair, waypoints: [{time: 0, position: [0, 1]}]}\n"));
  o.readout = 0;
  const SimulatedFrame at_once = Simulator(o).render_without_true_depth(7);
  o.readout = 0.033;
  const SimulatedFrame rolling = Simulator(o).render_without_true_depth(7);
  ASSERT_EQ(at_once.movers.size(), 1U);
  ASSERT_EQ(rolling.movers.size(), 1U);
  EXPECT_NE(at_once.movers[0].box_x, rolling.movers[0].box_x) << "its picture leans";
  // Across the view: two pixels of 7 mm. Taken for seen from the middle of the frame it would be 0.008 s * 4 rad/s * 2
  // m away. Along the view its median follows what of it is seen.
  EXPECT_NEAR(at_once.movers[0].position_in_world.x(), rolling.movers[0].position_in_world.x(), 0.015);
}

TEST_F(SimulatorFiles, SceneFileErrorsNameLineAndNearestKey) {
  const auto error = [&](const std::string& text) { return error_of(small(file("scene.yaml", text))); };
  const std::string path = "path:\n  - {time: 0, position: [0, 0, 1.4], look_at: [0, 1, 0.8]}\n";
  const std::pair<std::string, const char*> faults[] = {
      {path + "frame: 3\n", "3: unknown key \"frame\" (did you mean \"frames\"?); the keys are frames, "},
      {path + "room:\n  hight: 3\n", "4: unknown key \"room.hight\" (did you mean \"height\"?); the keys are size, "},
      {path + "? [1, 2]\n: 3\n", "3: a key must be a word"},
      {path + "tremor: 1\ntremor: 2\n", "4: tremor: is given twice; leave one out"},
      {"frames: 3\n", ": key \"path\" is missing"},
      {"\npath:\n  -\n    time: 0\n    position: [0, 0, 1]\n", "4: key \"path.look_at\" is missing"},
      {path + "people: many\n", "3: people: \"many\" is not a number"},
      {path + "frames: 1.5\n", "3: frames: \"1.5\" is not a whole number"},
      {path + "frames: 0\n", "3: frames: 0 is out of range; it must be 1 ... 1000000"},
      {path + "room: 3\n",
       "3: room: must be lines of the form `key: value`; the keys are size, height, floor, furnished"},
      {path + "room: {height: 12}\n", "3: room.height: 12 is out of range; it must be 2 ... 10"},
      {path + "room:\n  size: [6,\n   60]\n", "5: room.size: 60 is out of range; it must be 2 ... 50"},
      {path + "room: {furnished: 3}\n", "3: room.furnished: must be true or false"},
      {path + "room: {floor: grass}\n", "3: room.floor: \"grass\" is not one of planks, carpet, "},
      {path + "objects: 3\n", "3: objects: must be a list, e.g. [a, b]"},
      {path + "objects: []\n", "3: objects: must be a list of at least 1 entry"},
      {path + "objects:\n  -\n",
       "3: objects: must be lines of the form `key: value`; the keys are kind, position, yaw, size, material"},
      {path + "objects:\n  - {kind: desc, position: [0, 1]}\n",
       "4: objects.kind: \"desc\" is not one of box, ellipsoid, desk, shelf, cabinet, chair, plant, cartons (did you "
       "mean \"desk\"?)"},
      {path + "objects:\n  - {kind: desk, position: [0, 1],\n     size: [1, 1, 1]}\n",
       "5: objects.size: belongs to kind box and ellipsoid only; leave it out of kind desk"},
      {path + "objects:\n  - {kind: box, position: [0, 1]}\n", "4: objects.position: must be a list of 3 numbers [m]"},
      {path + "objects:\n  - {kind: box, position: [0, 1, 2], size: [1, 1, 0]}\n",
       "4: objects.size: 0 is out of range; it must be 0.005 ... 1000"},
      {path + "  - {time: 0, position: [0, 0, 1], look_at: [0, 1, 1]}\n",
       "3: path.time: must be later than that of the entry before"},
      {"path:\n  - {time: 0, position: [0, 0, 1.4], look_at: [0, 0, 0]}\n",
       "2: path.look_at: must not be straight above or below position"},
      {path + "movers:\n  - {class: cat, waypoints: [{time: 0, position: [0, 0]}]}\n",
       "4: movers.class: \"cat\" is not one of person, chair"},
      {path + "movers:\n  - waypoints:\n     - {time: 1, position: [0, 0]}\n     - {time: 1, position: [0, 0]}\n",
       "6: movers.waypoints.time: must be later than that of the entry before"},
      {"path: [\n", "2: is not valid YAML ("},
      {"", "1: must be lines of the form `key: value`; the keys are frames, "},
      {"- 3\n", "1: must be lines of the form `key: value`; the keys are frames, "}};
  for (const auto& [text, what] : faults) {
    const std::string said = error(text);
    EXPECT_NE(said.find("scene.yaml:" + std::string(*what == ':' ? "" : what)), std::string::npos) << said;
    EXPECT_NE(said.find(what), std::string::npos) << said;
    EXPECT_EQ(said.find(":0:"), std::string::npos) << said;
  }
}

TEST_F(SimulatorFiles, ACameraOutsideTheRoomIsRefused) {
  const auto error = [&](const std::string& position) {
    return error_of(small(file("scene.yaml", "room: {size: [5, 4], height: 2.5}\npath:\n  - time: 0\n    position: [" +
                                                 position + "]\n    look_at: [0, 1, 0.8]\n")));
  };
  EXPECT_EQ(error("0, 0, 2.4"), "no error");
  EXPECT_NE(error("0, 0, 2.5")
                .find("scene.yaml:4: path.position: (0, 0, 2.5) is outside the room; x must be between -2.5 "
                      "and 2.5, y between -2 and 2, z between 0 and 2.5, its height"),
            std::string::npos)
      << error("0, 0, 2.5");
  for (const char* outside : {"0, 0, 30", "0, 0, 0", "2.6, 0, 1", "0, -2.1, 1"})
    EXPECT_NE(error(outside).find("is outside the room"), std::string::npos) << outside;
}

}  // namespace
}  // namespace dkb
