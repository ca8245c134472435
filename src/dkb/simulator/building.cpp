// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dkb/simulator/interior.h"
#include "dkb/simulator/noise.h"
#include "dkb/simulator/route.h"
#include "dkb/simulator/scene.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;

//     B  ======================================  y 12     = corridors, 2 m wide, on their middle lines
//        |  R0 | R1  |  R2 | R3  |  R4 | R5  |            | corridors at x 0, 13, 26, 39
//     A  ======================================  y 0
//        |   S0    |   S1    |   S2    |   S3  |
constexpr double kHeight = 2.6, kWall = 0.15, kPitch = 13, kNorth = 12, kHalf = 1.0, kSouth = -6.2, kDoor = 1.1;  // [m]

class FloorPlan {
 public:
  FloorPlan(Scene* scene, uint64_t seed) : scene_(scene), seed_(seed) {}

  int add(const Footprint& area, Material floor, uint64_t look) {
    Cell& cell = scene_->cells.emplace_back();
    cell.area = area;
    gaps_.emplace_back();
    looks_.push_back(look);
    interior(last()).floor(area, floor);
    interior(last()).ceiling(area);
    return last();
  }
  // Two cells, one north of the other, open to each other between x0 and x1: what lies between their walls is a cell of
  // its own.
  enum class Gap { doorway, pane };
  void join(int south, int north, double x0, double x1, Gap kind) {
    const double y0 = area(south).y1, y1 = area(north).y0, height = kind == Gap::pane ? kHeight : 2.05;
    if (y1 - y0 < 1e-6) {  // corridors that meet
      gap(south, north, x0, x1, kHeight);
      connect(south, north, x0, x1, y0);
      return;
    }
    const int between = add({x0, y0, x1, y1}, Material::linoleum, 1);
    gap(south, north, x0, x1, height);
    connect(south, between, x0, x1, y0);
    connect(between, north, x0, x1, y1);
    Interior in = interior(between);
    in.wall({x0, y1}, {x0, y0});
    in.wall({x1, y0}, {x1, y1});
    if (kind == Gap::pane) {
      in.pane({x0, (y0 + y1) / 2}, {x1, (y0 + y1) / 2}, &scene_->glass);
      return;
    }
    Surfaces lintel;
    const int t = scene_->materials.get(Material::paint, 5, 1.0, kWall);
    lintel.add_box({x0, y0, height}, {x1 - x0, 0, 0}, {0, y1 - y0, 0}, {0, 0, 0.3}, {-1, -1, -1, -1, t, -1});
    scene_->cells[static_cast<size_t>(between)].furnishing.surfaces.append(lintel);
    // Frames stand on either side.
    interior(south).frame({x1, y0}, {x0, y0}, {0, x1 - x0, height});
    interior(north).frame({x0, y1}, {x1, y1}, {0, x1 - x0, height});
  }
  // A closed door that either side sees.
  void closed(int south, int north, double x0, double x1) {
    gap(south, north, x0, x1, 2.05);
    interior(south).closed_door({x1, area(south).y1}, {x0, area(south).y1}, {0, x1 - x0}, kWall / 2);
    interior(north).closed_door({x0, area(north).y0}, {x1, area(north).y0}, {0, x1 - x0}, kWall / 2);
  }
  // Once all gaps are known.
  void raise_walls() {
    for (int i = 0; i <= last(); ++i) {
      const Footprint r = area(i);
      if (r.y1 - r.y0 < 2 * kWall) continue;  // doorways have theirs
      Interior in = interior(i);
      std::vector<Opening> south, north;
      for (const auto& g : gaps_[static_cast<size_t>(i)])
        if (g.north)
          north.push_back({r.x1 - g.x1, r.x1 - g.x0, g.height});
        else
          south.push_back({g.x0 - r.x0, g.x1 - r.x0, g.height});
      for (auto* list : {&south, &north})
        std::sort(list->begin(), list->end(), [](const Opening& a, const Opening& b) { return a.from < b.from; });
      in.wall({r.x0, r.y0}, {r.x1, r.y0}, south);
      in.wall({r.x1, r.y1}, {r.x0, r.y1}, north);
      in.wall({r.x1, r.y0}, {r.x1, r.y1});
      in.wall({r.x0, r.y1}, {r.x0, r.y0});
    }
  }
  const Footprint& area(int cell) const { return scene_->cells[static_cast<size_t>(cell)].area; }
  // `variation`: see Furnisher.
  Furnisher furnisher(int cell, uint64_t look, uint64_t variation) {
    return {&scene_->materials, &scene_->cells[static_cast<size_t>(cell)].furnishing, hash64(seed_, look), variation};
  }

 private:
  struct Hole {
    double x0, x1, height;
    bool north;  // in the north wall of its cell
  };
  int last() const { return static_cast<int>(scene_->cells.size()) - 1; }
  Interior interior(int cell) {
    return {&scene_->materials, &scene_->cells[static_cast<size_t>(cell)].furnishing,
            hash64(seed_, 0x1F, looks_[static_cast<size_t>(cell)]), kHeight};
  }
  void gap(int south, int north, double x0, double x1, double height) {
    gaps_[static_cast<size_t>(south)].push_back({x0, x1, height, true});
    gaps_[static_cast<size_t>(north)].push_back({x0, x1, height, false});
  }
  void connect(int a, int b, double x0, double x1, double y) {
    scene_->cells[static_cast<size_t>(a)].portals.push_back({{x0, y}, {x1, y}, b});
    scene_->cells[static_cast<size_t>(b)].portals.push_back({{x0, y}, {x1, y}, a});
  }

  Scene* const scene_;
  const uint64_t seed_;
  std::vector<std::vector<Hole>> gaps_;  // by cell
  std::vector<uint64_t> looks_;
};

// An office of the southern row: doors in its north wall. Look-alikes but for their details.
void furnish_south(const Footprint& r, Furnisher f) {
  const double w = r.x1 - r.x0, d = r.y1 - r.y0;
  f.line_wall({r.x0 + 0.7, r.y0}, {1, 0}, w - 1.4, 0.7);
  f.line_wall({r.x1, r.y0 + 0.1}, {0, 1}, d - 0.8, 0.4);
  f.line_wall({r.x0, r.y1 - 0.7}, {0, -1}, d - 0.8, 0.3);
}

// An office between the corridors: one long wall is blank, the middle free.
void furnish_north(const Footprint& r, Furnisher f) {
  const double d = r.y1 - r.y0;
  f.line_wall({r.x1, r.y0 + 0.2}, {0, 1}, d - 0.4, 0.7);
  for (const double share : {0.25, 0.6})
    f.desk(placed(r.x0 + 0.01, r.y0 + share * d, 0, -std::numbers::pi / 2), 1.4, 0.75, Clutter::monitors);
}

void hang_posters(FloorPlan* plan, int corridor, const std::vector<std::array<double, 2>>& places, uint64_t look) {
  // (x, +1 north wall or -1 south wall) of corridors along x.
  const Footprint r = plan->area(corridor);
  Furnisher f = plan->furnisher(corridor, look, 0);
  for (const auto& [x, side] : places) {
    const Rigid3 wall = side > 0 ? placed(x, r.y1, 0, std::numbers::pi) : placed(x, r.y0, 0, 0);
    f.picture_on_wall(wall, -0.35, 1.0, 0.7, 0.9, Material::poster);
  }
}

std::vector<RouteCorner> way() {
  const double c = 1.3, d = 0.75;  // [m] radii in corridors and at doors
  const double r1 = 9.2, r2 = 16.8, room = -3.6;
  std::vector<RouteCorner> out{{{1.5, 0}, c}};
  const auto go = [&](double x, double y, double radius) { out.push_back({{x, y}, radius}); };
  const auto visit = [&](double x0, double x1) { go(x0, 0, d), go(x0, room, d), go(x1, room, d), go(x1, 0, d); };
  // Through R1, along B, back to the start: the first loop.
  go(r1, 0, d), go(r1, kNorth, d), go(0, kNorth, c), go(0, 0, c);
  visit(4.2, 7.2);
  // S1, up, along B, through R2, on in A where the robot was before: the second.
  visit(11.0, 15.0);
  go(2 * kPitch, 0, c), go(2 * kPitch, kNorth, c), go(r2, kNorth, d), go(r2, 0, d);
  visit(21.2, 24.2);
  // S3, the far corridor, and all of B: the third, back at the start.
  visit(31.5, 35.5);
  go(3 * kPitch, 0, c), go(3 * kPitch, kNorth, c), go(0, kNorth, c), go(0, 0, c), go(3.2, 0, c);
  return out;
}

void add_people(Scene* scene, const FloorPlan& plan, const std::vector<int>& rooms, const SceneRequest& request) {
  const int people = request.people >= 0 ? request.people : 2 * static_cast<int>(rooms.size());
  const auto count = static_cast<int>(rooms.size());
  for (int i = 0; i < count; ++i) {
    const int here = people / count + (i < people % count);
    const Cell& cell = scene->cells[static_cast<size_t>(rooms[static_cast<size_t>(i)])];
    scene->inside = plan.area(rooms[static_cast<size_t>(i)]);
    WalkArea area;
    area.obstacles = cell.furnishing.footprints;
    area.camera_distance = 0.85;
    const Footprint in = scene->inside;
    area.next_target = [in](Random& random) {
      const double y = random.uniform(in.y0, in.y1);
      return Vector2d(random.uniform(in.x0, in.x1), y);
    };
    SceneRequest own = request;
    own.seed = hash64(request.seed, static_cast<uint64_t>(i), 0x9E0);
    add_walkers(scene, area, here, scene->frames / request.fps, own);
  }
}

}  // namespace

Scene build_building(const SceneRequest& request) {
  Scene scene;
  scene.frames = request.frames > 0 ? request.frames : 6000;
  FloorPlan plan(&scene, hash64(request.seed, 0xB01D));
  const double east = 3 * kPitch + kHalf;
  const int a = plan.add({-kHalf, -kHalf, east, kHalf}, Material::linoleum, 1);
  const int b = plan.add({-kHalf, kNorth - kHalf, east, kNorth + kHalf}, Material::linoleum, 1);
  for (int i = 0; i < 4; ++i) {
    const double x = kPitch * i;
    const int across = plan.add({x - kHalf, kHalf, x + kHalf, kNorth - kHalf}, Material::linoleum, 1);
    plan.join(a, across, x - kHalf, x + kHalf, FloorPlan::Gap::doorway);
    plan.join(across, b, x - kHalf, x + kHalf, FloorPlan::Gap::doorway);
    Furnisher f = plan.furnisher(across, 20 + static_cast<uint64_t>(i), 0);
    const Footprint r = plan.area(across);
    f.picture_on_wall(placed(r.x1, r.y0 + 6.5, 0, std::numbers::pi / 2), 0, 1.0, 0.7, 0.9, Material::poster);
    f.picture_on_wall(placed(r.x0, r.y0 + 3.5, 0, -std::numbers::pi / 2), 0, 1.0, 0.6, 0.8, Material::picture);
  }
  std::vector<int> north, south;
  for (int i = 0; i < 6; ++i) {
    const double start = kPitch * (i / 2) + kHalf + kWall, width = (kPitch - 2 * kHalf - 3 * kWall) / 2;
    const double x0 = start + (i % 2) * (width + kWall), middle = x0 + width / 2;
    const int room = plan.add({x0, kHalf + kWall, x0 + width, kNorth - kHalf - kWall}, Material::planks, 2);
    north.push_back(room);
    plan.join(a, room, middle - kDoor / 2, middle + kDoor / 2, FloorPlan::Gap::doorway);
    if (i == 1 || i == 2)
      plan.join(room, b, middle - kDoor / 2, middle + kDoor / 2, FloorPlan::Gap::doorway);
    else
      plan.closed(room, b, middle - 0.475, middle + 0.475);
    if (i == 0 || i == 3) plan.join(a, room, x0 + 0.2, middle - 0.8, FloorPlan::Gap::pane);
    if (i == 4) plan.join(room, b, middle + 0.8, x0 + width - 0.2, FloorPlan::Gap::pane);
    furnish_north(plan.area(room), plan.furnisher(room, 3, static_cast<uint64_t>(i) + 1));
  }
  const std::array<std::array<double, 2>, 4> doors{{{4.2, 7.2}, {11.0, 15.0}, {21.2, 24.2}, {31.5, 35.5}}};
  for (size_t i = 0; i < 4; ++i) {
    const double width = (east + kHalf - 3 * kWall) / 4, x0 = -kHalf + static_cast<double>(i) * (width + kWall);
    const int room = plan.add({x0, kSouth, x0 + width, -kHalf - kWall}, Material::carpet, 4);
    south.push_back(room);
    for (const double x : doors[i]) plan.join(room, a, x - kDoor / 2, x + kDoor / 2, FloorPlan::Gap::doorway);
    furnish_south(plan.area(room), plan.furnisher(room, 5, i + 1));
  }
  plan.raise_walls();
  // Some of them opposite the doors that the robot comes out of.
  hang_posters(&plan, a,
               {{2.2, -1},
                {7.2, 1},
                {9.0, -1},
                {13.0, -1},
                {15.0, 1},
                {16.8, -1},
                {19.2, 1},
                {24.2, 1},
                {27.5, -1},
                {29.0, -1},
                {33.5, -1}},
               30);
  hang_posters(&plan, b, {{1.8, 1}, {9.2, 1}, {12.4, 1}, {15.0, -1}, {24.0, 1}, {33.0, 1}, {36.5, 1}}, 31);
  plan.furnisher(a, 32, 0).plant(placed(-kHalf + 0.01, 0, 0, -std::numbers::pi / 2));
  plan.furnisher(a, 33, 0).plant(placed(east - 0.01, 0, 0, std::numbers::pi / 2));
  plan.furnisher(b, 34, 0).plant(placed(-kHalf + 0.01, kNorth, 0, -std::numbers::pi / 2));

  const uint64_t seed = hash64(request.seed, 11);
  const double duration = (std::max(scene.frames, 6000) - 1) / request.fps;
  const CameraPath steady = smooth_path(Route(way()).drive(duration, Route::Drive()), 0.15);
  scene.path = [steady, seed](double t) {
    const Rigid3 p = steady(t);
    const Tremor h = hand_tremor(t, 0.002, 0.003, seed);
    return Rigid3((p.rotation * rotation_from_vector(Eigen::Vector3d(h.pitch, h.yaw, h.roll))).normalized(),
                  p.translation + h.shift);
  };
  add_people(&scene, plan, {south[1], south[3], north[2], north[3], north[5]}, request);
  return scene;
}

}  // namespace dkb::sim
