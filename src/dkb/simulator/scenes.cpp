// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dkb/simulator/noise.h"
#include "dkb/simulator/scene.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Rigid3 looking_at(const Vector3d& eye, const Vector3d& target, double t, double strength, uint64_t seed) {
  const Vector3d d = target - eye;
  return shaken(eye, std::atan2(d.y(), d.x()), std::atan2(d.z(), std::hypot(d.x(), d.y())), t, strength, seed);
}

// Walls lined with furniture; the sides are south, east, north, west.
void line_room(const Footprint& r, const std::array<double, 4>& depth_limit, Furnisher* f) {
  const double w = r.x1 - r.x0, d = r.y1 - r.y0, corner = 0.62;
  f->line_wall({r.x0 + corner, r.y0}, {1, 0}, w - 2 * corner, depth_limit[0]);
  f->line_wall({r.x1, r.y0 + corner}, {0, 1}, d - 2 * corner, depth_limit[1]);
  f->line_wall({r.x1 - corner, r.y1}, {-1, 0}, w - 2 * corner, depth_limit[2]);
  f->line_wall({r.x0, r.y1 - corner}, {0, -1}, d - 2 * corner, depth_limit[3]);
}

void desk_facing_south(double x, double y, Furnisher* f) {
  f->desk(placed(x, y + 0.75, 0, std::numbers::pi), 1.4, 0.75, Clutter::monitors);
}

int frames_of(const SceneRequest& request, int usual) {
  return request.frames > 0 ? request.frames : usual;
}
int people_of(const SceneRequest& request, int usual) {
  return request.people >= 0 ? request.people : usual;
}

Scene build_room(const SceneRequest& request) {
  // The path is made first; the room is furnished around it as around any given path.
  std::vector<TimedPose> poses;
  const uint64_t seed = hash64(request.seed, 5);
  const int frames = frames_of(request, 300);
  for (double t = 0; t <= (frames - 1) / request.fps + 0.1; t += 0.01) {
    const Vector3d eye(0.42 * std::sin(0.9 * t), -1.0 + 0.2 * std::sin(1.23 * t + 1), 1.42 + 0.14 * std::sin(1.46 * t));
    const Vector3d target(0.35 * std::sin(0.7 * t + 1), 0.15 + 0.12 * std::sin(0.5 * t), 0.82);
    poses.push_back({t, looking_at(eye, target, t, 1, seed)});
  }
  SceneRequest around = request;
  around.frames = frames;
  Scene scene = build_scene_around(poses, around);
  scene.start_stamp = Scene().start_stamp;
  return scene;
}

// A hall with desks at the far side, seen by a hand-held camera at its south end.
Scene open_hall(const SceneRequest& request, double sway) {
  Scene scene;
  scene.frames = frames_of(request, 300);
  scene.inside = {-3.6, -3.4, 3.6, 3.0};
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  f.shell(scene.inside.x0, scene.inside.y0, scene.inside.x1, scene.inside.y1, 2.7, Material::planks);
  line_room(scene.inside, {0.6, 0.45, 0.45, 0.45}, &f);
  for (const double x : {-1.5, 0.0, 1.5}) desk_facing_south(x, 1.25, &f);
  const uint64_t seed = hash64(request.seed, 6);
  scene.path = [seed, sway](double t) {
    const Vector3d eye(0.45 * sway * std::sin(0.8 * t), -1.9 + 0.25 * sway * std::sin(0.57 * t),
                       1.38 + 0.12 * sway * std::sin(1.1 * t));
    const Vector3d target(0.5 * sway * std::sin(0.45 * t + 0.6), 1.4, 0.95);
    return looking_at(eye, target, t, 1, seed);
  };
  return scene;
}

// The same room at 2 % of the light. A long exposure (and with it the blur of motion) and an amplification of 10, the
// most that such sensors do, bring back 43 % of the contrast. The picture is made of so few electrons (6000 would be
// white, were nothing amplified) that they can be seen one by one: their variance is the level x 10 x 255 / 6000.
Scene build_dim(const SceneRequest& request) {
  constexpr double kLight = 0.02, kAmplification = 10, kWell = 6000;
  Scene scene = build_room(request);
  const double usual = scene.exposure;
  scene.exposure = 0.030;
  scene.brightness = kLight * kAmplification * scene.exposure / usual;
  scene.photon_noise = kAmplification * 255 / kWell;
  return scene;
}

Scene build_crowd(const SceneRequest& request) {
  Scene scene = open_hall(request, 1);
  WalkArea area;
  area.no_stop.push_back({-0.9, -2.6, 0.9, -1.0});
  area.camera_distance = 0.9;
  add_walkers(&scene, area, people_of(request, 6), scene.frames / request.fps, request);
  return scene;
}

Scene build_spin(const SceneRequest& request) {
  Scene scene;
  scene.frames = frames_of(request, 300);
  scene.exposure = 0.010;
  scene.inside = {-2.4, -2.2, 2.4, 2.2};
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  f.shell(scene.inside.x0, scene.inside.y0, scene.inside.x1, scene.inside.y1, 2.6, Material::planks);
  line_room(scene.inside, {0.6, 0.6, 0.6, 0.6}, &f);
  const uint64_t seed = hash64(request.seed, 7);
  scene.path = [seed](double t) {
    // 60 degrees a second on average, 85 at most.
    const double yaw = 1.047 * t + 0.35 * std::sin(1.2 * t);
    return shaken({0.15 * std::cos(0.8 * t), 0.15 * std::sin(0.8 * t), 1.4}, yaw, -0.2 + 0.08 * std::sin(0.9 * t), t,
                  0.7, seed);
  };
  if (request.people > 0) add_walkers(&scene, WalkArea{}, request.people, scene.frames / request.fps, request);
  return scene;
}

Scene build_rush(const SceneRequest& request) {
  Scene scene;
  scene.frames = frames_of(request, 300);
  scene.inside = {-4.0, -3.0, 4.0, 3.0};
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  f.shell(scene.inside.x0, scene.inside.y0, scene.inside.x1, scene.inside.y1, 2.7, Material::planks);
  line_room(scene.inside, {0.45, 0.2, 0.45, 0.2}, &f);
  desk_facing_south(-1.0, 1.35, &f);
  desk_facing_south(0.9, 1.4, &f);
  const Rigid3 pose = camera_pose({0, -2.2, 1.3}, std::numbers::pi / 2, -0.12);
  scene.path = [pose](double) { return pose; };
  const int people = people_of(request, 5);
  const double duration = scene.frames / request.fps;
  Random random(hash64(request.seed, 0x5057));
  for (int i = 0; i < people; ++i) {
    // Everybody has a lane, near to far, and rushes along it to and fro.
    const double lane = people > 1 ? -1.0 + 1.9 * i / (people - 1) : 0.0;
    std::vector<Waypoint> points;
    double side = random.below(2) == 0 ? -1 : 1, t = -random.uniform(0.5, 2.5);
    if (request.stand_still > 0) {
      t = request.stand_still + random.uniform(0, 0.6);
      points.push_back({{random.uniform(-1.0, 1.0), lane}, t});
    } else {
      points.push_back({{side * 3.2, lane}, t});
    }
    while (t < duration) {
      t += 6.4 / random.uniform(2.0, 3.4);
      side = -side;
      points.push_back({{side * 3.2, lane}, t});
      t += random.uniform(0.1, 0.9);
      points.push_back({{side * 3.2, lane}, t});
    }
    add_mover(&scene, "person", track_along(points, duration, request.stand_still > 0),
              hash64(request.seed, static_cast<uint64_t>(i)));
  }
  return scene;
}

Scene build_straight(const SceneRequest& request) {
  Scene scene;
  scene.frames = frames_of(request, 300);
  scene.inside = {-1.6, -2.0, 7.8, 2.0};
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  f.shell(scene.inside.x0, scene.inside.y0, scene.inside.x1, scene.inside.y1, 2.6, Material::planks);
  line_room(scene.inside, {0.49, 0.6, 0.49, 0.2}, &f);
  // Half a metre a second; with more frames than that needs, slower.
  const double duration = (std::max(scene.frames, 300) - 1) / request.fps;
  scene.path = [duration](double t) { return camera_pose({5.0 * eased(t / duration, 0.06), 0, 1.05}, 0, -0.08); };
  WalkArea area;
  area.no_stop.push_back({-1, -0.7, 6.6, 0.7});
  area.camera_distance = 0.95;
  const double end = scene.frames / request.fps;
  area.next_target = [duration, end](Random& random) {
    const double cart = 5.0 * eased(random.uniform(0, end) / duration, 0.06);
    const double aside = random.uniform(-1.3, 1.3);
    return Vector2d(cart + random.uniform(0.8, 3.6), aside);
  };
  add_walkers(&scene, area, people_of(request, 4), end, request);
  return scene;
}

Scene build_cover(const SceneRequest& request) {
  Scene scene = open_hall(request, 0.3);
  const double duration = scene.frames / request.fps;
  const CameraPath path = scene.path;
  if (request.people != 0) {
    // In from the side, in front of the camera, and out again.
    Track track;
    const bool stands = request.stand_still > 0;  // before the camera, from the first frame
    const double arrive = stands ? -1e3 : std::min(2.6, 0.3 * duration),
                 leave = stands ? request.stand_still : std::max(0.75 * duration, duration - 2.0);
    double phase = 0;
    const auto where = [&](double time) -> Vector2d {
      const double t = stands ? std::max(time, leave) : time;
      const Rigid3 camera = path(t);
      const Vector3d ahead = camera.rotation * Vector3d::UnitZ();
      // Follows the camera half-way, sways on its own.
      const double x = 0.8 * camera.translation.x() + 0.3 * ahead.x() + 0.05 * std::sin(1.3 * t),
                   y = camera.translation.y() + 0.62 + 0.03 * std::sin(0.7 * t);
      const double in = eased((t - (arrive - 1.4)) / 1.4, 0.3), out = eased((t - leave) / 1.4, 0.3);
      return {x + 2.4 * (1 - in) - 2.4 * out, y + 0.25 * (1 - in) + 0.25 * out};
    };
    for (double t = 0; t < duration + 0.1; t += Track::kStep) {
      MoverState s;
      s.position = where(t);
      s.velocity = (where(t + 0.01) - where(t - 0.01)) / 0.02;
      const double speed = s.velocity.norm(),
                   inside = eased((t - arrive + 0.5) / 0.5, 0.3) * (1 - eased((t - leave) / 0.5, 0.3));
      s.heading = std::numbers::pi + (std::numbers::pi / 2) * inside;  // walks along -x, turns to the camera
      s.stride = std::min(1.2, speed / 1.1) * (1 - inside) + 0.1 * inside;
      phase += Track::kStep * 6.2832 * (0.2 + 0.5 * speed);
      s.phase = phase;
      track.push(s);
    }
    add_mover(&scene, "person", track, request.seed);
    scene.movers.back().look.girth = 1.25;
    scene.movers.back().look.arms_out = 0.12;
  }
  if (request.people > 1) {
    WalkArea area;
    area.no_stop.push_back({-1.4, -2.6, 1.4, -0.6});
    area.camera_distance = 1.6;  // behind the one in front
    add_walkers(&scene, area, request.people - 1, duration, request);
  }
  return scene;
}

Scene build_chair(const SceneRequest& request) {
  Scene scene = open_hall(request, 0.7);
  Random random(hash64(request.seed, 0xC4A1));
  const double duration = scene.frames / request.fps;
  std::vector<Waypoint> points{{{-0.9, 0.1}, 0.4}};
  double t = 0.4;
  for (int i = 1; t < duration; ++i) {
    const double y = random.uniform(-0.55, 0.6);
    const Vector2d next((i % 2 == 0 ? -1 : 1) * random.uniform(0.4, 1.2), y);
    t += (next - points.back().position).norm() / random.uniform(0.5, 0.9) + 0.35;
    points.push_back({next, t});
    if (random.below(2) == 0) {
      t += random.uniform(0.3, 1.5);
      points.push_back({next, t});
    }
  }
  add_mover(&scene, "chair", track_along(points, duration), request.seed);
  if (request.people > 0) {
    WalkArea area;
    area.no_stop.push_back({-1.6, -2.6, 1.6, 1.0});
    area.obstacles.push_back({-1.6, -0.9, 1.6, 1.0});  // the chair's ground
    add_walkers(&scene, area, request.people, duration, request);
  }
  return scene;
}

// A ring of two rooms and two corridors around a core; the path runs round it once and on over its start.
Scene build_loop(const SceneRequest& request) {
  Scene scene;
  scene.frames = frames_of(request, 900);
  scene.inside = {-4.5, -4.3, 4.5, 3.6};
  const Footprint r = scene.inside;
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  const double h = 2.6;
  f.shell(r.x0, r.y0, r.x1, r.y1, h, Material::planks);
  f.block(-2.2, -1.2, 2.2, 1.2, h);
  struct Side {
    Vector2d start, along;
    double length, depth;
  };
  const std::vector<Side> walls{{{r.x0 + 0.7, r.y0}, {1, 0}, 7.6, 0.7},   {{r.x1, r.y0 + 0.1}, {0, 1}, 2.9, 0.45},
                                {{r.x1, -1.1}, {0, 1}, 2.2, 0.2},         {{r.x1, 1.25}, {0, 1}, 1.7, 0.45},
                                {{r.x1 - 0.7, r.y1}, {-1, 0}, 7.6, 0.45}, {{r.x0, r.y1 - 0.6}, {0, -1}, 1.7, 0.45},
                                {{r.x0, 1.1}, {0, -1}, 2.2, 0.2},         {{r.x0, -1.3}, {0, -1}, 2.2, 0.45}};
  for (const Side& s : walls) f.line_wall(s.start, s.along, s.length, s.depth);
  // The core's outside: the room lies to the left when going round it clockwise.
  f.line_wall({2.2, -1.2}, {-1, 0}, 4.4, 0.3);
  f.line_wall({-2.2, -1.2}, {0, 1}, 2.4, 0.2);
  f.line_wall({-2.2, 1.2}, {1, 0}, 4.4, 0.2);
  f.line_wall({2.2, 1.2}, {0, -1}, 2.4, 0.2);
  // Partitions with a doorway each.
  for (const double y : {-1.2, 1.2})
    for (const double side : {-1.0, 1.0}) {
      const double a = side * 2.2, b = side * 2.62, c = side * 3.72, d = side * 4.5;
      for (const auto& [p, q] : {std::pair{a, b}, std::pair{c, d}}) {
        const double x0 = std::min(p, q), x1 = std::max(p, q);
        f.block(x0, y - 0.05, x1, y + 0.05, h);
        f.line_wall({x0, y + 0.05}, {1, 0}, x1 - x0, 0.1);
        f.line_wall({x1, y - 0.05}, {-1, 0}, x1 - x0, 0.1);
      }
    }
  f.desk(placed(-0.4, -3.05, 0, std::numbers::pi), 1.4, 0.75, Clutter::monitors);

  const uint64_t seed = hash64(request.seed, 8);
  const double duration = (std::max(scene.frames, 900) - 1) / request.fps;
  scene.path = [seed, duration](double t) {
    // Rounded rectangle, anticlockwise from the middle of the south side.
    const double a = 3.2, b = 2.2, radius = 0.95;
    const double straight_x = 2 * (a - radius), straight_y = 2 * (b - radius), arc = radius * std::numbers::pi / 2;
    const double round = 2 * (straight_x + straight_y) + 4 * arc, length = round + 0.8;
    double s = std::fmod(length * eased(t / duration, 0.03) + straight_x / 2, round), heading = 0;
    Vector2d p(-(a - radius), -b);
    const std::array<double, 4> sides{straight_x, straight_y, straight_x, straight_y};
    for (int i = 0;; i = (i + 1) % 4) {
      const Vector2d along(std::cos(heading), std::sin(heading)), left(-along.y(), along.x());
      if (s < sides[static_cast<size_t>(i)]) {
        p += s * along;
        break;
      }
      s -= sides[static_cast<size_t>(i)];
      p += sides[static_cast<size_t>(i)] * along;
      if (s < arc) {
        const double angle = s / radius;
        p += radius * (std::sin(angle) * along + (1 - std::cos(angle)) * left);
        heading += angle;
        break;
      }
      s -= arc;
      p += radius * (along + left);
      heading += std::numbers::pi / 2;
    }
    return shaken({p.x(), p.y(), 1.35}, heading - 0.3, -0.14, t, 1, seed);
  };
  if (request.people > 0) add_walkers(&scene, WalkArea{}, request.people, scene.frames / request.fps, request);
  return scene;
}

// Two rooms of the same furniture, a corridor between them. The camera looks north and slides east, once.
Scene build_twins(const SceneRequest& request) {
  Scene scene;
  scene.frames = frames_of(request, 900);
  const double width = 4.4, corridor = 2.4, pitch_x = width + corridor + 0.2, h = 2.6, south = -1.6, north = 2.3;
  scene.inside = {0, south, pitch_x + width, north};
  for (int room = 0; room < 2; ++room) {
    const double x0 = room * pitch_x, x1 = x0 + width;
    // The same seed, hence the same layout; details differ.
    Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0x7712), static_cast<uint64_t>(room));
    f.shell(x0, south, x1, north, h, Material::planks);
    f.line_wall({x1 - 0.1, north}, {-1, 0}, width - 0.2, 0.6);
    f.line_wall({x0 + 0.6, south}, {1, 0}, width - 1.2, 0.4);
    f.desk(placed(x0 + 2.3, 1.6, 0, std::numbers::pi), 1.4, 0.65, Clutter::monitors);
  }
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0x7713));
  f.shell(width + 0.1, south, width + 0.1 + corridor, 1.7, h, Material::planks);
  f.line_wall({width + corridor, 1.7}, {-1, 0}, corridor - 0.1, 0.2);
  // Doorways: the walls in the way of the camera are taken out and put back beside the opening.
  auto& patches = scene.furnishing.surfaces.patches;
  patches.erase(std::remove_if(patches.begin(), patches.end(),
                               [&](const Patch& p) {
                                 const bool across =
                                     std::abs(p.u.x()) < 1e-9 && std::abs(p.v.x()) < 1e-9 && p.u.norm() > 3;
                                 return across && p.origin.x() > 0.05 && p.origin.x() < pitch_x + width - 0.05;
                               }),
                patches.end());
  for (const double x : {width, width + 0.1 + corridor}) {
    f.block(x, 0.75, x + 0.1, north, h);
    f.block(x, south, x + 0.1, -0.75, h);
    f.line_wall({x, 0.75}, {0, 1}, north - 0.8, 0.1);                 // seen from the west
    f.line_wall({x + 0.1, north - 0.05}, {0, -1}, north - 0.8, 0.1);  // and from the east
  }
  const uint64_t seed = hash64(request.seed, 9);
  const double duration = (std::max(scene.frames, 900) - 1) / request.fps;
  scene.path = [seed, duration, pitch_x](double t) {
    // From room to room the camera does exactly the same; only the hand's tremor differs.
    const double x = 0.75 + 9.9 * eased(t / duration, 0.03), along = 6.283185307 * (x - 0.75) / pitch_x;
    return shaken({x, 0.06 * std::sin(along), 1.36 + 0.04 * std::sin(2 * along)},
                  std::numbers::pi / 2 + 0.14 * std::cos(along), -0.16, t, 1, seed);
  };
  if (request.people > 0) add_walkers(&scene, WalkArea{}, request.people, scene.frames / request.fps, request);
  return scene;
}

}  // namespace

void add_mover(Scene* scene, const std::string& kind, Track track, uint64_t seed) {
  Mover m;
  m.id = static_cast<int>(scene->movers.size()) + 1;
  m.kind = kind;
  m.track = std::move(track);
  if (kind == "person")
    m.look = make_person_look(&scene->materials, seed);
  else
    m.rigid = Furnisher::make_chair(&scene->materials, seed).moved(placed(0, 0, 0, -std::numbers::pi / 2));
  scene->movers.push_back(std::move(m));
}

void add_walkers(Scene* scene, WalkArea area, int count, double duration, const SceneRequest& request) {
  const CameraPath path = scene->path;
  area.stand_still = request.stand_still;
  area.first_place = [path](Random& random) -> Vector2d {
    const Rigid3 pose = path(0);
    const Vector3d ahead = pose.rotation * Vector3d::UnitZ();
    const double yaw = std::atan2(ahead.y(), ahead.x()) + random.uniform(-0.42, 0.42);
    return pose.translation.head<2>() + random.uniform(1.3, 3.4) * Vector2d(std::cos(yaw), std::sin(yaw));
  };
  area.inside = scene->inside;
  area.obstacles.insert(area.obstacles.end(), scene->furnishing.footprints.begin(), scene->furnishing.footprints.end());
  area.camera = [path](double t) -> Vector2d { return path(t).translation.head<2>(); };
  if (!area.next_target)
    area.next_target = [path, duration](Random& random) -> Vector2d {
      const Rigid3 pose = path(random.uniform(0, duration));
      const Vector3d ahead = pose.rotation * Vector3d::UnitZ();
      const Vector2d axis = Vector2d(ahead.x(), ahead.y()) / std::max(1e-3, std::hypot(ahead.x(), ahead.y()));
      return pose.translation.head<2>() + random.uniform(1.1, 3.2) * axis +
             random.uniform(-1.6, 1.6) * Vector2d(-axis.y(), axis.x());
    };
  uint64_t i = 0;
  for (Track& track : plan_walks(area, count, duration, request.seed))
    add_mover(scene, "person", std::move(track), hash64(request.seed, 100 + i++));
}

Scene build_scene(const SceneRequest& request) {
  if (request.name == "room") return build_room(request);
  if (request.name == "crowd") return build_crowd(request);
  if (request.name == "loop") return build_loop(request);
  if (request.name == "spin") return build_spin(request);
  if (request.name == "rush") return build_rush(request);
  if (request.name == "straight") return build_straight(request);
  if (request.name == "cover") return build_cover(request);
  if (request.name == "chair") return build_chair(request);
  if (request.name == "twins") return build_twins(request);
  if (request.name == "corridor") return build_corridor(request);
  if (request.name == "building") return build_building(request);
  if (request.name == "dim") return build_dim(request);
  throw std::logic_error("no scene of the name " + request.name);
}

}  // namespace dkb::sim
